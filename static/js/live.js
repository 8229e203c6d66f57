// Words for what plays, and for how a live source is doing.

export const KINDS = { device: "Device", emulator: "Emulator", recording: "Recording" };

const DEVICE_STATES = {
  connecting: "Connecting",
  streaming: "Streaming",
  stalled: "Stalled, no data arrives",
  reconnecting: "Reconnecting by itself once the lidar is back",
  closed: "Closed",
};

const PLAYER_STATES = {
  loading: "Loading",
  playing: "Playing",
  paused: "Paused",
  ended: "Ended",
  error: "Cannot be read on",
};

export function nameOf({ kind, recording, device }) {
  if (kind === "recording") return recording;
  const model = device?.name ?? "lidar";
  return kind === "emulator" ? `Emulated ${model.replace("RPLIDAR ", "")}` : model;
}

/** What the coloured dots stand for: the state of a live source, or how a recording plays. */
export const stateOf = ({ device, state }) => device?.state ?? state;

/** The same in words; a live source goes on while the page is paused. */
export function stateText({ device, state }) {
  if (!device) return PLAYER_STATES[state] ?? state;
  const text = DEVICE_STATES[device.state] ?? device.state;
  return state === "paused" && device.state === "streaming" ? `${text}, the page is paused` : text;
}

/** What keeps a live source from showing anything new, with its cure; empty if nothing does. */
export function troubleOf({ device }) {
  if (!device || device.state === "streaming") return "";
  return [stateText({ device }), device.error].filter(Boolean).join(". ");
}
