// The colours of style.css, for canvases: they follow the site's light or dark scheme.

const NAMES = ["panel", "text", "muted", "line", "floor", "wall", "seen", "scan", "robot", "ghost", "trail", "left",
  "right", "setpoint", "fault"];

/** Return the colours that are in force now, by name. */
export function colours(element) {
  const style = getComputedStyle(element);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--robot-${name}`)]));
}
