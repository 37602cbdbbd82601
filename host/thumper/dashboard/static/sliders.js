// Keys of a focused slider: arrows move it by 1 % of its range, Page Up and Page Down by 10 %. Its own step is the
// fine one of its number field, for the mouse.

const SHARES = { ArrowLeft: -0.01, ArrowDown: -0.01, ArrowRight: 0.01, ArrowUp: 0.01, PageDown: -0.1, PageUp: 0.1 };

export function startSliders() {
  document.addEventListener("keydown", (event) => {
    const slider = event.target.closest?.("[data-slider]");
    const share = SHARES[event.key];
    if (!slider || !share) return;
    event.preventDefault();
    event.stopImmediatePropagation(); // Quasar would move it by its step
    const field = document.querySelector(`[data-gain="${slider.dataset.slider}"]`);
    const [low, high] = ["aria-valuemin", "aria-valuemax"].map((name) => Number(slider.getAttribute(name)));
    const step = Number(field.step);
    const move = Math.sign(share) * Math.max(step, Math.round((Math.abs(share) * (high - low)) / step) * step);
    const value = Math.min(high, Math.max(low, Number(field.value) + move));
    field.value = Number(value.toFixed(3));
    field.dispatchEvent(new Event("input", { bubbles: true })); // as if it was typed
  }, true);
}
