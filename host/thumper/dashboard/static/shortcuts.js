// The list of keyboard shortcuts: "?" shows and hides it, Esc hides it.

import { onCancel } from "./commands.js";
import { TOOLS } from "./map_tools.js";

const GENERAL = [
  ["Space", "Emergency stop, everywhere"],
  ["Esc", "Cancel the tool, close a menu; else emergency stop"],
  ["Arrow keys, Enter", "On the map: move the cross-hair, use the tool there"],
  ["Shift", "While driving with the joystick: ignore obstacles"],
  ["?", "Show or hide this list"],
];

export function startShortcuts() {
  const list = document.body.appendChild(document.createElement("dl"));
  list.className = "tp-shortcuts";
  list.hidden = true;
  list.setAttribute("role", "dialog");
  list.setAttribute("aria-label", "keyboard shortcuts");
  const tools = Object.values(TOOLS).map(({ key, title }) => [key.toUpperCase(), title.split(":")[0]]);
  for (const [keys, text] of [...tools, ...GENERAL]) {
    list.appendChild(document.createElement("dt")).textContent = keys;
    list.appendChild(document.createElement("dd")).textContent = text;
  }
  document.addEventListener("keydown", (event) => {
    if (event.key === "?" && !/INPUT|TEXTAREA|SELECT/.test(event.target.tagName)) list.hidden = !list.hidden;
  });
  list.addEventListener("click", () => { list.hidden = true; });
  onCancel(() => {
    const isActive = !list.hidden;
    list.hidden = true;
    return isActive;
  });
}
