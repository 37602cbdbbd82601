// Colours of the style sheet (`--tp-*`) for canvas and charts.

const FALLBACK = "#888";
const cache = new Map();

export function colour(name) {
  if (!cache.has(name)) {
    cache.set(name, getComputedStyle(document.body).getPropertyValue(`--tp-${name}`).trim() || FALLBACK);
  }
  return cache.get(name);
}

export function isDark() {
  return document.body.classList.contains("body--dark");
}

export function onThemeChange(listener) {
  new MutationObserver(() => {
    cache.clear();
    listener();
  }).observe(document.body, { attributes: true, attributeFilter: ["class"] });
}
