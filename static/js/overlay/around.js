// What the stream does not carry, asked for while the pointer is over the view: the measured points and the trail.

import { request } from "../api.js";
import { get, set } from "../store.js";
import { throttled } from "../throttle.js";
import { placer } from "./world.js";

const REFRESH_MS = 1000;

/** Keeps {sequence, beams, poses} of the newest frame as "around" in the store. */
export const lookAround = throttled(REFRESH_MS, async () => {
  if (get("frame").sequence === get("around")?.sequence) return;
  const asked = ["frame?points=true", "trajectory"].map((path) => request("GET", path));
  const found = await Promise.all(asked).catch(() => null); // asked again with the next frame
  if (!found) return;
  const [{ sequence, points, localization, stamp }, { poses }] = found;
  const place = placer(localization?.pose);
  set("around", {
    sequence,
    beams: points.map((xy) => ({ kind: "beam", at: place(xy), range: Math.hypot(...xy), bearing: Math.atan2(xy[1], xy[0]) })),
    poses: poses.map((pose) => ({ ...pose, kind: "pose", at: [pose.x, pose.y], age: stamp - pose.stamp })),
  });
});
