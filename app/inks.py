"""The colours of what the scene draws that is not coloured by method, for a dark and a light page."""

import numpy as np

from app.colours import Rgbs, rgb

INKS = {
    "dark": {
        "cell": "#1f242c", "section": "#39414d", "label": "#7b8796", "points": "#9fb0c8", "sensor": "#f1f3f5",
        "rejected": "#ff5c5c", "ring": "#ffe14d", "cluster": "#e58fd0", "landmark": "#5ad1a4", "tentative": "#6b7686",
        "trail": "#e8c468", "reckoned": "#8a6fb0", "true": "#4f8fd0", "association": "#c8d2e0", "ambiguous": "#ff9d5c",
    },
    "light": {
        "cell": "#eef0f3", "section": "#d0d6de", "label": "#6a7482", "points": "#56657a", "sensor": "#15181c",
        "rejected": "#c92a2a", "ring": "#b88a00", "cluster": "#a83a90", "landmark": "#0b7a55", "tentative": "#9aa5b4",
        "trail": "#a86f00", "reckoned": "#7b4fb0", "true": "#1f6fb8", "association": "#46536a", "ambiguous": "#c45a00",
    },
}  # fmt: skip


def ink(theme: str, name: str) -> Rgbs:
    """The colour (3,) of something in a theme."""
    return np.array(rgb(INKS[theme][name]), np.uint8)
