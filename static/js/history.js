// The last frames' figures, for the plots: bounded, in order of arrival.

const LENGTH = 600;
const LATELY = 300; // frames, half a minute

const samples = [];

/** Notes a frame's figures, its age only if it is `isNew`, not shown again; `now` in seconds. */
export function remember(frame, isNew, now = performance.now() / 1000) {
  const { summary, localization, clusters, timings, source } = frame;
  samples.push({
    now,
    kind: source.kind,
    summary,
    localization,
    extract: timings.extract_us,
    cluster: clusters ? timings.cluster_us : NaN,
    locate: timings.locate_us ?? NaN,
    draw: timings.draw_us,
    age: isNew ? timings.age_ms * 1e3 : NaN,
  });
  if (samples.length > LENGTH) samples.shift();
}

/** Begins anew: what was noted belongs to another source or map. */
export function forget() {
  samples.length = 0;
}

/** The value below which such a part of a figure lies, over the last frames of this kind of source. */
export function quantile(read, part) {
  const { kind } = samples.at(-1) ?? {};
  const values = samples
    .slice(-LATELY)
    .filter((sample) => sample.kind === kind)
    .map(read);
  const known = values.filter(Number.isFinite);
  return known.sort((a, b) => a - b)[Math.floor(part * known.length)] ?? NaN;
}

/** Columns for a plot: seconds before the newest frame, then one column per reader of what `rows` makes of a sample. */
export function columns(readers, rows = (sample) => [sample]) {
  const newest = samples.at(-1)?.now ?? 0;
  const all = samples.flatMap((sample) => rows(sample).map((row) => ({ row, time: sample.now - newest })));
  const known = (value) => (Number.isFinite(value) ? value : null);
  return [all.map(({ time }) => time), ...readers.map((read) => all.map(({ row }) => known(read(row))))];
}
