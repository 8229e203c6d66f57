// Work that need not be done for every frame.

/** Runs `action` at most every `wait` ms: soon, or else when the time has come, with the newest arguments. */
export function throttled(wait, action) {
  let timer = 0;
  let last = -Infinity;
  let newest;
  const run = () => {
    timer = 0;
    last = performance.now();
    action(...newest);
  };
  return (...args) => {
    newest = args;
    timer ||= setTimeout(run, Math.max(0, last + wait - performance.now()));
  };
}
