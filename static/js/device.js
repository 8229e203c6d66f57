// The lidar that streams: what it does, what was lost on the way, what it is, and its mode and speed to change.

import { $, el, remake, setText } from "./dom.js";
import { quantile } from "./history.js";
import { open, transport } from "./session.js";
import { get, on } from "./store.js";
import { bytes, degrees, fixed, milliseconds, percent, wholeNumber } from "./units.js";

const SLOWEST_RPM = 480;
const FASTEST_RPM = 900;

const FIGURES = [
  { key: "rate", label: "Scans", text: ({ rate_hz }) => `${fixed(rate_hz, 1)}\u2009/s` },
  { key: "samples", label: "Samples", text: ({ samples_per_s }) => `${wholeNumber(samples_per_s)}\u2009/s` },
  { key: "completeness", label: "Complete", text: ({ completeness }) => percent(completeness) },
  { key: "latency", label: "Latency, median", text: () => latency(0.5) },
  { key: "latency-99", label: "Latency, 99 %", text: () => latency(0.99) },
  { key: "revolutions", label: "Revolutions", text: ({ revolutions }) => wholeNumber(revolutions) },
  { key: "bytes", label: "Received", text: (device) => bytes(device.bytes) },
  { key: "reconnects", label: "Reconnects", text: ({ reconnects }) => reconnects },
  { key: "overruns", label: "Overruns", text: ({ overruns }) => overruns },
];

const FACTS = [
  { label: "Port", text: ({ port }) => port },
  { label: "Model", text: ({ name }) => name },
  { label: "Serial", text: ({ serial }) => serial },
  { label: "Firmware", text: ({ firmware, hardware }) => `${firmware}, hardware ${hardware}` },
  { label: "Health", text: ({ health }) => health },
  { label: "Baud", text: ({ baud }) => wholeNumber(baud) },
];

/** From the revolution's last byte to the frame sent, over the last frames. */
const latency = (part) => milliseconds(quantile(({ age }) => age, part));

const mode = el("select", { id: "device-mode" });
const rpm = el("input", {
  type: "number",
  id: "device-rpm",
  min: String(SLOWEST_RPM),
  max: String(FASTEST_RPM),
  step: "10",
});

export function mountDevice() {
  mode.addEventListener("change", changeMode);
  rpm.addEventListener("change", () => rpm.reportValidity() && transport.patch({ rpm: Number(rpm.value) }));
  const figures = FIGURES.map(({ key, label }) => pair(label, el("dd", { id: `device-${key}` })));
  $("device").append(
    el("dl", { class: "figures" }, ...figures),
    el("dl", { class: "losses", id: "device-losses" }),
    el("div", { class: "row" }, el("label", { for: mode.id }, "Scan mode"), mode),
    el(
      "div",
      { class: "row number" },
      el("label", { for: rpm.id }, "Motor speed"),
      rpm,
      el("span", { class: "unit" }, "rpm"),
    ),
    el("dl", { class: "facts", id: "device-facts" }),
  );
  on(["source"], draw);
}

const pair = (label, value) => el("div", {}, el("dt", {}, label), value);
const line = (label, text) => pair(label, el("dd", { title: String(text) }, String(text)));

function draw({ device }) {
  $("device").hidden = !device;
  if (!device) return;
  for (const { key, text } of FIGURES) setText($(`device-${key}`), text(device));
  const losses = Object.entries(device.dropped);
  const lost = lostText(get("frame")?.gaps ?? []);
  remake($("device-losses"), [losses, lost], () => [
    ...losses.map(([reason, count]) => line(`Dropped, ${reason.replaceAll("_", " ")}`, wholeNumber(count))),
    line("Lost in this scan", lost),
  ]);
  remake(
    $("device-facts"),
    FACTS.map(({ text }) => text(device)),
    () => FACTS.map(({ label, text }) => line(label, text(device) ?? "\u2013")),
  );
  remake(mode, [device.modes, device.mode], () =>
    device.modes.map((name) => el("option", { value: name, selected: name === device.mode }, name)),
  );
  if (document.activeElement !== rpm) rpm.value = String(device.rpm);
}

function lostText(gaps) {
  const angle = gaps.reduce((sum, [from, to]) => sum + to - from, 0);
  return gaps.length
    ? `${gaps.length} ${gaps.length > 1 ? "sectors" : "sector"}, ${degrees(angle)}°`
    : "nothing";
}

/** A mode is chosen when scanning starts, so the source is opened anew. */
function changeMode() {
  const { kind, device } = get("source");
  const where = kind === "device" ? { port: device.port, baud: device.baud } : {};
  open({ kind, ...where, mode: mode.value, rpm: device.rpm });
}
