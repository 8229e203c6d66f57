// The serial ports of the server's machine: those that look like a lidar first. One is chosen to play.

import { request } from "./api.js";
import { $, el, iconButton, remake } from "./dom.js";
import { attempt, open } from "./actions.js";
import { on, set } from "./store.js";

const NOTHING = "n/a"; // as a system describes a port it knows nothing of

export function mountDevices() {
  $("devices")
    .querySelector(".section-head")
    .append(iconButton("reload", "Look for devices again", refresh));
  on(["panel"], (panel) => panel === "sources" && refresh());
  on(["devices", "source"], (devices, { kind, device }) => {
    const current = kind === "device" ? device?.port : null;
    remake($("device-list"), [devices, current], () => list(devices, current));
  });
}

async function refresh() {
  const section = $("devices");
  section.setAttribute("aria-busy", "true");
  const devices = await attempt(() => request("GET", "devices"), "The devices could not be listed");
  section.setAttribute("aria-busy", "false");
  if (devices) set("devices", devices);
}

function list(devices, current) {
  if (!devices.length)
    return [el("p", { class: "muted" }, "No serial port. Plug the lidar in, then look again.")];
  const likely = devices.filter((device) => device.looks_like);
  const others = devices.filter((device) => !device.looks_like);
  const rows = [...likely, ...others].map((device) => row(device, current));
  return [el("ul", { class: "entries" }, ...rows)];
}

function row({ path, name, description, serial, error, looks_like: likely }, current) {
  const title = name ?? (likely ? "Perhaps an RPLIDAR" : "Another serial port");
  const button = el(
    "button",
    { type: "button", class: "entry", "data-key": path, onclick: () => open({ kind: "device", port: path }) },
    el("span", {}, title),
    el("small", {}, path),
  );
  if (path === current) button.setAttribute("aria-current", "true");
  const about =
    error ?? [![path, NOTHING].includes(description) && description, serial].filter(Boolean).join(", ");
  const line = el("p", { class: error ? "about fault" : "about muted" }, about);
  return el("li", { class: likely ? "" : "unlikely" }, button, ...(about ? [line] : []));
}
