// Colours that canvas and charts share with the style sheet.

const cache = new Map();

export function colour(name) {
  if (!cache.has(name)) {
    cache.set(name, getComputedStyle(document.body).getPropertyValue(`--tp-${name}`).trim() || "#888");
  }
  return cache.get(name);
}

export function onTheme(listener) {
  new MutationObserver(() => {
    cache.clear();
    listener();
  }).observe(document.body, { attributes: true, attributeFilter: ["class"] });
}
