// Buttons that order: any element with `data-order` sends that JSON at a click. E-stop: button, Space, Esc.

import { on, send, state } from "./stream.js";

export function stopNow() {
  const sent = send({ kind: "estop" });
  document.body.classList.add("tp-stopped");
  setTimeout(() => document.body.classList.remove("tp-stopped"), 600);
  if (!sent) notify("No connection: the stop could not be sent. The robot stops by itself.", "bad");
}

export function notify(text, kind) {
  const list = document.getElementById("tp-notices");
  if (!list) return;
  const line = list.appendChild(document.createElement("div"));
  line.className = `tp-notice ${kind}`;
  line.textContent = text;
  while (list.children.length > 3) list.firstChild.remove();
  setTimeout(() => line.remove(), 6000);
}

export function startOrders() {
  // Captured, and before any widget: a focused button or field must not swallow the stop.
  document.addEventListener("keydown", (event) => {
    if (event.code !== "Space" && event.code !== "Escape") return;
    if (event.code === "Space") event.preventDefault();
    if (!event.repeat) stopNow();
  }, true);
  document.addEventListener("keyup", (event) => {
    if (event.code === "Space") event.preventDefault(); // a button acts at the key's release
  }, true);
  document.addEventListener("pointerdown", (event) => {
    if (event.target.closest?.("[data-estop]")) stopNow(); // at the press, not at the release
  }, true);
  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-order]");
    if (!button) return;
    if (!send(JSON.parse(button.dataset.order))) notify("No connection to the server", "bad");
  });
  document.addEventListener("click", (event) => {
    if (!event.target.closest?.("[data-record]")) return;
    send({ kind: "command", name: state.values.status?.recording ? "record_stop" : "record_start" });
  });
  on("server:refused", ({ text }) => notify(text, "bad"));
  on("server:note", ({ text }) => notify(text, "good"));
}
