// Faults to try on the emulator: how the page and the driver bear them is worth seeing before it matters.

import { request } from "./api.js";
import { $, el } from "./dom.js";
import { attempt, open } from "./actions.js";
import { get, on } from "./store.js";
import { toast } from "./toasts.js";

const FAULTS = [
  { label: "Unplug", commands: ["unplug"] },
  { label: "Plug in again", commands: ["replug"] },
  { label: "Stall for 2 s", commands: ["stall 2"] },
  { label: "Flip bits in 2 %", commands: ["flip 0.02"] },
  { label: "Lose 5 %", commands: ["lose 0.05"] },
  { label: "No more faults", commands: ["flip 0", "lose 0"] },
];

export function mountFaults() {
  const buttons = FAULTS.map(({ label, commands }) =>
    el("button", { type: "button", onclick: () => disturb(commands) }, label),
  );
  $("faults").append(
    el("p", { class: "muted" }, "Faults of the emulated lidar, to see how the driver and this page cope. Percentages are of its data packets."),
    el("div", { class: "fault-buttons" }, ...buttons),
  );
  on(["source"], ({ kind }) => ($("faults").hidden = kind !== "emulator"));
}

/** An emulator that has ended can bear no fault; another one can be had. */
function disturb(commands) {
  const { error } = get("source");
  if (!error) return attempt(() => sendAll(commands), "The fault could not be applied");
  const action = { label: "Start a new one", run: () => open({ kind: "emulator" }) };
  return toast(error, { title: "The emulator has ended", kind: "error", action, about: "source" });
}

async function sendAll(commands) {
  for (const command of commands) await request("POST", "emulator", { command });
}
