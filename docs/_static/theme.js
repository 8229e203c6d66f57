// Before the first paint: the theme the reader chose, else that of the system.
document.body.dataset.theme = localStorage.getItem("theme") || "auto";
