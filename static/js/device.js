// The lidar that streams: what it does, what was lost on the way, what it is, and its mode and speed to change.

import { $, el, remake, setText } from "./dom.js";
import { quantile } from "./history.js";
import { isStale } from "./live.js";
import { open, transport } from "./actions.js";
import { get, on } from "./store.js";
import { bytes, COMPLETE_HINT, degrees, fixed, milliseconds, percent, UNKNOWN, wholeNumber } from "./units.js";

const SLOWEST_RPM = 480;
const FASTEST_RPM = 900;

const LATENCY_HINT = "From the last byte of a revolution to sending it to this page, over the last half minute";

/** What was counted, or (`now`) what comes at present, which is not known when nothing comes. */
const FIGURES = [
  { key: "rate", label: "Scans", now: true, text: ({ rate_hz }) => `${fixed(rate_hz, 1)}\u2009/s` },
  {
    key: "samples",
    label: "Samples",
    now: true,
    text: ({ samples_per_s }) => `${wholeNumber(samples_per_s)}\u2009/s`,
  },
  {
    key: "completeness",
    label: "Complete",
    hint: COMPLETE_HINT,
    now: true,
    text: ({ completeness }) => percent(completeness),
  },
  { key: "latency", label: "Latency, median", hint: LATENCY_HINT, now: true, text: () => latency(0.5) },
  { key: "latency-99", label: "Latency, 99 %", hint: LATENCY_HINT, now: true, text: () => latency(0.99) },
  { key: "revolutions", label: "Revolutions", text: ({ revolutions }) => wholeNumber(revolutions) },
  { key: "bytes", label: "Received", text: (device) => bytes(device.bytes) },
  {
    key: "reconnects",
    label: "Reconnects",
    hint: "Connections to the sensor after the first",
    text: ({ reconnects }) => reconnects,
  },
  {
    key: "overruns",
    label: "Overruns",
    hint: "Revolutions that arrived while the server was too busy to process them",
    text: ({ overruns }) => overruns,
  },
];

/** Why the decoder left something out, by the reasons the server counts. */
const LOSSES = {
  missing_packets: {
    label: "Missing packets",
    hint: "Packets that never arrived, inferred from the angle of the next one",
  },
  damaged_packets: {
    label: "Damaged packets",
    hint: "Packets with a wrong checksum",
  },
  unfit_packets: {
    label: "Inconsistent packets",
    hint: "Intact packets whose angle does not fit their neighbours, for example while the motor changes speed",
  },
  garbage_bytes: {
    label: "Stray bytes",
    hint: "Bytes between packets that belong to no packet",
  },
};

const FACTS = [
  { label: "Port", text: ({ port }) => port },
  { label: "Model", text: ({ name }) => name },
  { label: "Serial", text: ({ serial }) => serial },
  { label: "Firmware", text: ({ firmware, hardware }) => `${firmware}, hardware ${hardware}` },
  { label: "Health", text: ({ health }) => health },
  {
    label: "Checksum",
    text: ({ checked }) => (checked ? "in every packet" : "none in this mode: a wrong distance goes unnoticed"),
  },
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
  const figures = FIGURES.map(({ key, label, hint }) => pair(label, el("dd", { id: `device-${key}` }), hint));
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
  on(["source", "connection"], draw);
}

const pair = (label, value, hint = "") => el("div", { title: hint }, el("dt", {}, label), value);
const line = (label, text, hint = String(text)) => pair(label, el("dd", {}, String(text)), hint);

function draw({ device }, connection) {
  $("device").hidden = !device;
  if (!device) return;
  const stale = isStale({ device }, connection);
  $("device").classList.toggle("stale", stale);
  for (const { key, now, text } of FIGURES)
    setText($(`device-${key}`), stale && now ? UNKNOWN : text(device));
  const losses = Object.entries(device.dropped);
  const lost = lostText(get("frame")?.gaps ?? []);
  remake($("device-losses"), [losses, lost], () => [
    ...losses.map(([reason, count]) =>
      line(LOSSES[reason]?.label ?? reason, wholeNumber(count), LOSSES[reason]?.hint),
    ),
    line("Lost in this scan", lost, "Sectors of this revolution from which no data arrived"),
  ]);
  remake(
    $("device-facts"),
    FACTS.map(({ text }) => text(device)),
    () => FACTS.map(({ label, text }) => line(label, text(device) ?? UNKNOWN)),
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
