// The list of keyboard shortcuts: "?" shows and hides it, Esc hides it.

import { isTyping, onCancel } from "./commands.js";
import { TOOLS } from "./map_tools.js";

const GENERAL = [
  ["Space", "Emergency stop; in a text field only while the motors are on"],
  ["Esc", "Cancel the tool, close a menu; else emergency stop"],
  ["Arrow keys, Enter", "On the map: move the cross-hair, use the tool there"],
  ["W A S D, arrow keys", "While the tab Drive is open: drive as long as they are held"],
  ["Shift", "While driving: ignore obstacles"],
  ["?", "Show or hide this list"],
];

export const HAS_KEYBOARD = !window.matchMedia("(hover: none)").matches;
// A key in brackets, for a text; empty on a device without a keyboard.
export const keyHint = (key) => (HAS_KEYBOARD ? ` (${key})` : "");

export function startShortcuts() {
  const dialog = document.body.appendChild(document.createElement("div"));
  dialog.className = "tp-shortcuts";
  dialog.hidden = true;
  dialog.setAttribute("role", "dialog");
  dialog.setAttribute("aria-label", "keyboard shortcuts");
  const head = dialog.appendChild(document.createElement("header"));
  head.appendChild(document.createElement("h2")).textContent = "Keyboard shortcuts";
  const close = head.appendChild(document.createElement("button"));
  Object.assign(close, { type: "button", className: "tp-icon", title: "Close (Esc)", innerHTML: '<i class="material-icons">close</i>' });
  let opener = null;
  const show = (isShown) => {
    if (isShown) opener = document.activeElement;
    const hasFocus = dialog.contains(document.activeElement);
    dialog.hidden = !isShown;
    if (isShown) close.focus();
    else if (hasFocus) opener.focus();
  };
  close.addEventListener("click", () => show(false));
  // The only control keeps the focus. showModal() would do so as well, but no click would reach the STOP button.
  close.addEventListener("keydown", (event) => { if (event.key === "Tab") event.preventDefault(); });
  const list = dialog.appendChild(document.createElement("dl"));
  const tools = Object.values(TOOLS).map(({ key, title }) => [key.toUpperCase(), title.split(":")[0]]);
  for (const [keys, text] of [...tools, ...GENERAL]) {
    list.appendChild(document.createElement("dt")).textContent = keys;
    list.appendChild(document.createElement("dd")).textContent = text;
  }
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-shortcuts]")) show(dialog.hidden);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "?" && !isTyping(event)) show(dialog.hidden);
  });
  onCancel(() => {
    const isActive = !dialog.hidden;
    if (isActive) show(false);
    return isActive;
  });
}
