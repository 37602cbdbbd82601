// Keeps simulated time beside real time, while the robot is on the screen and its page in front.

const FRAME_MS = 12;  // of processor time per frame at most; a slower machine runs slower than real time

/** Run `step()` once per millisecond and `draw(rate)` once per frame; `rate` is simulated by real time. */
export function run(element, step, draw) {
  let visible = true, before = null, owed_ms = 0, rate = 1;
  new IntersectionObserver(([entry]) => (visible = entry.isIntersecting)).observe(element);
  const frame = (now) => {
    requestAnimationFrame(frame);
    const elapsed_ms = before === null ? 0 : Math.min(now - before, 100);
    before = now;
    if (!visible) return;
    owed_ms += elapsed_ms;
    const end = performance.now() + FRAME_MS;
    let done_ms = 0;
    for (; owed_ms >= 1 && performance.now() < end; --owed_ms, ++done_ms) step();
    owed_ms = Math.min(owed_ms, 5);
    if (elapsed_ms > 0) rate += 0.02 * (done_ms / elapsed_ms - rate);
    draw(rate);
  };
  requestAnimationFrame(frame);
}
