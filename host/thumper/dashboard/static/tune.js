// Experiments that the robot runs on its own: identify the motors, tune the wheels. Shows progress, result, report.

import { faultBlock } from "./faults.js";
import { HAS_KEYBOARD } from "./shortcuts.js";
import { on, send } from "./stream.js";

const EXPERIMENTS = ["identify", "tune"];
const TAKES_S = { identify: 45, tune: 90 }; // of a simulated robot, in real time

const FEW_LINES = 4; // the motors of both sides are shown at once

// "38 %, about 60 s left"; empty if the share is not known.
function progressText({ running, share }) {
  if (!share) return "";
  const left_s = 10 * Math.ceil(((1 - share) * TAKES_S[running]) / 10);
  return `${Math.round(100 * share)} %${left_s ? `, about ${left_s} s left` : ""}`;
}

// Length of the lane [m] that the open page or step asks for; 0 if it asks for none.
export function laneLength() {
  const lane = [...document.querySelectorAll("[data-lane]")].find((one) => one.offsetParent);
  return Number(lane?.value ?? lane?.dataset.lane ?? 0);
}

export function tune(root) {
  root.innerHTML = `
    <p>The robot drives back and forth on its own. It needs a clear lane, 0.8 m wide and equally long ahead
      of it and behind it. To stop it, press ${HAS_KEYBOARD ? "Space" : "STOP"} or Cancel, or leave this page.</p>
    <label class="tp-check">Lane <input class="tp-lane" data-lane type="number" min="0.6" max="10" step="0.1" value="1.2">
      m ahead and behind</label>
    <label class="tp-check"><input type="checkbox" data-tune="clear"> The lane is clear</label>
    <div class="tp-buttons">
      <button type="button" class="tp-go" data-tune="identify" disabled>Identify motors</button>
      <button type="button" class="tp-go" data-tune="tune" disabled>Tune wheels</button>
      <button type="button" class="tp-plain" data-tune="cancel" disabled>Cancel</button>
    </div>
    <p class="tp-hint">Tuning takes about ${TAKES_S.tune} s, identifying the motors about ${TAKES_S.identify} s.</p>
    <p class="tp-hint" data-tune="why" hidden></p>
    <div class="tp-progress" hidden><div></div></div>
    <p class="tp-message" role="status"></p>
    <details hidden><summary>Details</summary><div class="tp-lines"></div></details>
    <a href="/report" target="_blank" hidden>Open the report in a new tab</a>
    <iframe title="report" sandbox hidden></iframe>`;
  const find = (name) => root.querySelector(`[data-tune=${name}]`);
  const laneClear = find("clear");
  const laneLength = root.querySelector(".tp-lane");
  const progress = root.querySelector(".tp-progress");
  const message = root.querySelector(".tp-message");
  const details = root.querySelector("details");
  const resultLines = root.querySelector(".tp-lines");
  const reportLink = root.querySelector("a");
  const reportFrame = root.querySelector("iframe");
  let lastState = "";
  let running = "";
  let mode = "idle";
  let fault = "";
  // A focused report would receive the keys, and Space must always reach the page's emergency stop.
  window.addEventListener("blur", () => setTimeout(() => {
    if (document.activeElement === reportFrame) reportFrame.blur();
  }));

  const updateButtons = () => {
    const isOn = !running && !["idle", "experiment"].includes(mode);
    const isBlocked = isOn || (!running && fault !== "");
    for (const name of EXPERIMENTS) find(name).disabled = Boolean(running) || isBlocked || !laneClear.checked;
    find("cancel").disabled = !running;
    find("why").hidden = !isBlocked;
    find("why").textContent = !isOn ? `${fault}.` : mode === "holding" ? "The motors are on: disarm the robot first."
      : `The robot is ${mode}: stop it first.`;
  };
  laneClear.addEventListener("change", updateButtons);
  for (const name of EXPERIMENTS) {
    find(name).addEventListener("click", () => send({ kind: "experiment", name, lane_m: Number(laneLength.value) }));
  }
  find("cancel").addEventListener("click", () => send({ kind: "command", name: "cancel" }));

  on("status", (status) => {
    const now = [status.mode.toLowerCase(), faultBlock(status)];
    if (now[0] === mode && now[1] === fault) return;
    [mode, fault] = now;
    updateButtons();
  });
  on("experiment", (state) => {
    const text = JSON.stringify(state);
    if (text === lastState) return;
    lastState = text;
    if (running && !state?.running) laneClear.checked = false; // confirm again before the next experiment
    running = state?.running ?? "";
    updateButtons();
    progress.hidden = !running;
    progress.firstChild.style.width = `${100 * (running ? state.share : 0)}%`;
    message.classList.toggle("bad", Boolean(state?.problem));
    message.textContent = running
      ? [progressText(state), state.what].filter(Boolean).join(": ")
      : state ? state.problem || state.what : "This robot cannot run experiments.";
    const lines = (state?.lines ?? []).filter((line) => running || line !== state.what); // the result is above
    resultLines.replaceChildren(...lines.map((line) => {
      const row = document.createElement("div");
      row.textContent = line;
      return row;
    }));
    details.hidden = lines.length === 0;
    if (!running) details.open = lines.length <= FEW_LINES;
    const hasReport = Boolean(state?.has_report) && !running;
    if (hasReport && reportFrame.hidden) reportFrame.src = `/report?${Date.now()}`;
    reportLink.hidden = reportFrame.hidden = !hasReport;
  });
}
