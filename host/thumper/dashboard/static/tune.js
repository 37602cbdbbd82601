// Experiments that the robot drives by itself: identify its motors, tune its wheels; progress, result, report.

import { on, send } from "./stream.js";

export function tune(root) {
  root.innerHTML = `
    <p>The robot drives to and fro by itself. It needs a lane 0.8 m wide, free ahead of it and as far behind it.
      Space, Esc or Cancel stop it, and so does leaving this page.</p>
    <label class="tp-check">Lane <input class="tp-lane" type="number" min="0.6" max="10" step="0.1" value="1.2">
      m ahead and behind</label>
    <label class="tp-check"><input type="checkbox" data-tune="free"> The lane is free</label>
    <div class="tp-buttons">
      <button type="button" class="tp-go" data-tune="identify" disabled>Identify motors</button>
      <button type="button" class="tp-go" data-tune="tune" disabled>Tune wheels</button>
      <button type="button" class="tp-plain" data-tune="cancel" disabled>Cancel</button>
    </div>
    <div class="tp-progress"><div></div></div>
    <p class="tp-message" role="status"></p>
    <div class="tp-lines"></div>
    <a href="/report" target="_blank" hidden>Open the report in a tab of its own</a>
    <iframe title="report" sandbox hidden></iframe>`;
  const find = (name) => root.querySelector(`[data-tune=${name}]`);
  const lane = root.querySelector(".tp-lane");
  const bar = root.querySelector(".tp-progress div");
  const message = root.querySelector(".tp-message");
  const lines = root.querySelector(".tp-lines");
  const link = root.querySelector("a");
  const frame = root.querySelector("iframe");
  let shown = "";
  let running = "";
  // Keys that are typed into the report would not reach the page, and Space is the stop.
  window.addEventListener("blur", () => setTimeout(() => {
    if (document.activeElement === frame) frame.blur();
  }));

  const enable = () => {
    for (const name of ["identify", "tune"]) find(name).disabled = Boolean(running) || !find("free").checked;
    find("cancel").disabled = !running;
  };
  find("free").addEventListener("change", enable);
  for (const name of ["identify", "tune"]) {
    find(name).addEventListener("click", () => send({ kind: "experiment", name, lane_m: Number(lane.value) }));
  }
  find("cancel").addEventListener("click", () => send({ kind: "command", name: "cancel" }));

  on("experiment", (state) => {
    const text = JSON.stringify(state);
    if (text === shown) return;
    shown = text;
    if (running && !state?.running) find("free").checked = false; // ask again before the next
    running = state?.running ?? "";
    enable();
    bar.style.width = `${100 * (running ? state.share : 0)}%`;
    message.classList.toggle("bad", Boolean(state?.problem));
    message.textContent = running ? `${running}: ${state.what} ${state.share ? Math.round(100 * state.share) + " %" : ""}`
      : state?.problem ?? "This robot takes no experiments.";
    lines.replaceChildren(...(state?.lines ?? []).map((line) => {
      const row = document.createElement("div");
      row.textContent = line;
      return row;
    }));
    const report = Boolean(state?.has_report) && !running;
    if (report && frame.hidden) frame.src = `/report?${Date.now()}`;
    link.hidden = frame.hidden = !report;
  });
}
