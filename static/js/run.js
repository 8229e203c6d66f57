// Whether a frame goes on from the one before it, or another source, world or map has begun.

const SAME_S = 0.5; // between the beginnings of one source as two of its frames tell

let before = null;

/** Notes a frame; returns whether what was seen so far says nothing of it. */
export function isNewRun({ stamp, source, localization }) {
  const now = { kind: source.kind, start: stamp - source.time, session: localization?.session ?? null };
  const was = before ?? now;
  before = now;
  const isOther = now.kind !== was.kind || Math.abs(now.start - was.start) > SAME_S;
  return isOther || (was.session !== null && now.session !== was.session);
}
