// The last frames' figures, for the plots: bounded, in order of arrival.

const LENGTH = 600;

const samples = [];

/** Notes a frame's figures; `now` in seconds. */
export function remember(frame, now = performance.now() / 1000) {
  const { extract_us: extract, draw_us: draw, age_ms: age } = frame.timings;
  samples.push({ now, extract, draw, age: age * 1e3, summary: frame.summary });
  if (samples.length > LENGTH) samples.shift();
}

/** Columns for a plot: seconds before the newest frame, then one column per reader of a sample. */
export function columns(readers) {
  const newest = samples.at(-1)?.now ?? 0;
  const known = (value) => (Number.isFinite(value) ? value : null);
  return [
    samples.map(({ now }) => now - newest),
    ...readers.map((read) => samples.map((s) => known(read(s)))),
  ];
}
