// Words for what plays, and for how a live source is doing.

export const KINDS = {
  device: "Device",
  emulator: "Emulator",
  simulation: "Simulation",
  recording: "Recording",
};

const DEVICE_STATES = {
  connecting: "Connecting",
  streaming: "Streaming",
  stalled: "Stalled, no data arrives",
  reconnecting: "Disconnected, reconnects when the lidar is back",
  closed: "Closed",
};

const PLAYER_STATES = {
  loading: "Loading",
  playing: "Playing",
  paused: "Paused",
  ended: "Ended",
  error: "Stopped at an error",
};

export function nameOf({ kind, recording, device }) {
  if (kind === "recording") return recording;
  if (kind === "simulation") return "Simulated robot";
  const model = device?.name ?? "lidar";
  return kind === "emulator" ? `Emulated ${model.replace("RPLIDAR ", "")}` : model;
}

/** What the coloured dots stand for: the state of a live source, or how a recording plays. */
export const stateOf = ({ device, state }, connection) =>
  connection === "lost" ? "lost" : (device?.state ?? state);

/** Whether what is shown is not what happens now: nothing comes from the server, or nothing from the sensor. */
export const isStale = ({ device }, connection) =>
  connection === "lost" || Boolean(device && device.state !== "streaming");

/** The same as the dots in words; a live source goes on while the page is paused. */
export function stateText({ device, state }, connection) {
  if (connection === "lost") return "Unknown, the connection is lost";
  if (!device) return PLAYER_STATES[state] ?? state;
  const text = DEVICE_STATES[device.state] ?? device.state;
  return state === "paused" && device.state === "streaming" ? `${text}, the page is paused` : text;
}

/** What keeps a live source from showing anything new, with its cure; empty if nothing does. */
export function troubleOf({ device, error }) {
  if (!device || device.state === "streaming") return "";
  return [stateText({ device }), device.error ?? error].filter(Boolean).join(". ");
}
