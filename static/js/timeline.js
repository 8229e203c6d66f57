// Transport: play, step, seek, speed, loop. A live source has no end: pausing freezes it, the last scans can be
// stepped back through, and playing jumps to what is live.

import { $, el, iconButton, setIcon, setText } from "./dom.js";
import { isStale, stateOf } from "./live.js";
import { recorderControls } from "./recorder.js";
import { isPlaying, step, togglePlaying, transport } from "./actions.js";
import { on } from "./store.js";
import { clock, wholeNumber } from "./units.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 100];
const AS_FAST_AS_POSSIBLE = 0;

const play = iconButton("pause", "Pause", togglePlaying);
const back = iconButton("back", "One scan back", () => step(-1));
const forward = iconButton("forward", "One scan forward", () => step(1));
const seek = el("input", {
  type: "range",
  id: "seek",
  min: "0",
  value: "0",
  "aria-label": "Position in the recording",
});
const time = el("output", { id: "time", for: "seek" }, "0:00.0");
const duration = el("span", { id: "duration", class: "muted" });
const position = el("output", { id: "position", for: "seek" }, "");
const badge = el("span", { id: "live", class: "state" });
const speed = el("select", { "aria-label": "Speed", title: "Speed", id: "speed" });
const loop = iconButton("loop", "Play in a loop", () =>
  transport.patch({ loop: loop.getAttribute("aria-pressed") !== "true" }),
);

export function mountTimeline() {
  const texts = [...SPEEDS.map((value) => [value, `${value}×`]), [AS_FAST_AS_POSSIBLE, "max"]];
  speed.append(...texts.map(([value, text]) => el("option", { value: String(value) }, text)));
  speed.addEventListener("change", () => transport.patch({ speed: Number(speed.value) }));
  seek.addEventListener("input", () => transport.patch({ index: Number(seek.value) }));
  $("timeline").append(
    el("div", { class: "buttons" }, back, play, forward),
    el("div", {}, time, duration),
    badge,
    seek,
    position,
    el("div", { class: "buttons pace" }, speed, loop),
    recorderControls(),
  );
  $("timeline").addEventListener("click", releaseFocus);
  on(["source", "connection"], drawSource);
  on(["source", "frame"], drawPosition);
}

/** A button that was pressed by the pointer leaves the space key to play and pause. */
function releaseFocus({ detail, target }) {
  if (detail) target.closest("button")?.blur();
}

function drawSource(source, connection) {
  const playing = isPlaying(source);
  setIcon(play, playing ? "pause" : "play");
  const label = playing ? "Pause" : source.live ? "Back to live" : "Play";
  play.setAttribute("aria-label", label);
  play.title = label;
  $("timeline").classList.toggle("live", source.live);
  badge.dataset.state = source.state === "paused" ? "paused" : stateOf(source, connection);
  setText(badge, badgeText(source, connection));
  setText(duration, source.duration ? ` / ${clock(source.duration)}` : "");
  loop.setAttribute("aria-pressed", String(source.loop));
  if (document.activeElement !== speed) showSpeed(source.speed);
}

function badgeText(source, connection) {
  if (source.state === "paused") return "Paused";
  return isStale(source, connection) ? "No signal" : "Live";
}

/** A speed set elsewhere may be none of ours. */
function showSpeed(value) {
  if (![...speed.options].some((option) => Number(option.value) === value)) {
    speed.append(el("option", { value: String(value) }, `${value}×`));
  }
  speed.value = String(value);
}

function drawPosition(source, frame) {
  const current = frame.source.kind === source.kind ? frame.source : source;
  const index = transport.pending().index ?? current.index;
  setText(time, clock(current.time));
  if (source.live) return setText(position, isPlaying(source) ? "" : `scan ${wholeNumber(index + 1)}`);
  seek.max = String(Math.max(0, (source.count ?? 1) - 1));
  seek.setAttribute("aria-valuetext", `scan ${index + 1} of ${source.count}, ${clock(current.time)}`);
  if (!seek.matches(":active")) seek.value = String(index);
  if (source.state === "loading") return setText(position, "loading");
  const loading = source.complete ? "" : "+";
  setText(position, `${index + 1}\u2009/\u2009${source.count ?? "?"}${loading}`);
}
