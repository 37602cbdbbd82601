// Numbers and words of the page: every element with `data-field` shows the value of that name.

import { on, state } from "./stream.js";

const LINK_LOST_S = 1.5; // no message of the robot for so long

const fixed = (digits, unit) => (value) => (value === null || value === undefined ? "–" : `${value.toFixed(digits)} ${unit}`);
const ms = (value) => (value === null || value === undefined ? "–" : `${(1000 * value).toFixed(0)} ms`);

const FIELDS = {
  robot: ({ status }) => status?.robot ?? "",
  mode: ({ status }) => words(status?.mode),
  reason: ({ status }) => status?.reason ?? "",
  board_state: ({ board, status }) => words(board?.state ?? status?.board_state),
  battery: ({ board }) => fixed(2, "V")(board?.battery_V),
  distance: ({ status }) => (status?.has_goal ? fixed(2, "m")(status.distance_to_goal_m) : "–"),
  pose: ({ pose }) => (pose ? `${pose[0].toFixed(2)}, ${pose[1].toFixed(2)} m` : "–"),
  heading: ({ pose }) => (pose ? `${Math.round((pose[2] * 180) / Math.PI)}°` : "–"),
  loop_late: ({ status }) => ms(status?.loop_late_s),
  loop_busy: ({ status }) => ms(status?.loop_busy_s),
  telemetry_age: ({ status }) => ms(status?.telemetry_age_s),
  scan_age: ({ status }) => ms(status?.scan_age_s),
  link_frames: ({ status }) => count(status?.link_frames),
  link_errors: ({ status }) => count(status?.link_errors),
  lost_edges: ({ status }) => count(status?.lost_edges),
  lidar_scans: ({ status }) => count(status?.lidar_scans),
  lidar_errors: ({ status }) => count(status?.lidar_errors),
  lidar_restarts: ({ status }) => count(status?.lidar_restarts),
  counts: ({ board }) => (board ? board.counts.join(" / ") : "–"),
  pages: ({ pages }) => count(pages),
  rtt: () => (state.rttMs === null ? "–" : `${state.rttMs.toFixed(0)} ms`),
  recorded: ({ recording_s }) => clock(recording_s),
  fault_words: ({ status }) => status?.fault_words ?? "",
  fault_cure: ({ status }) => status?.fault_cure ?? "",
  operator: ({ operator }) => (!operator ? "nobody" : operator === state.me ? "this page" : "another page"),
};

function words(name) {
  return name ? name.toLowerCase().replaceAll("_", " ") : "–";
}

function count(value) {
  return value === undefined || value === null ? "–" : value.toLocaleString("en-US").replaceAll(",", " ");
}

function clock(seconds) {
  if (seconds === null || seconds === undefined) return "";
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function banner({ status, silent_s }) {
  if (!state.connected) return ["lost", "No connection to the dashboard's server. The robot stops by itself."];
  if (silent_s === null || silent_s === undefined) return ["lost", "Waiting for the robot …"];
  if (silent_s > LINK_LOST_S) return ["lost", `No word from the robot for ${silent_s.toFixed(0)} s. Is \`thumper run\` at work?`];
  if (!status) return ["lost", "Waiting for the robot …"];
  return status.simulated
    ? ["simulated", "Simulated robot"]
    : ["real", "Real robot: it moves"];
}

function refresh() {
  const values = state.values;
  for (const element of document.querySelectorAll("[data-field]")) {
    const text = String(FIELDS[element.dataset.field]?.(values) ?? "");
    if (element.textContent !== text) element.textContent = text;
  }
  const [kind, text] = banner(values);
  const bar = document.getElementById("tp-banner");
  if (bar && (bar.dataset.kind !== kind || bar.textContent !== text)) {
    bar.dataset.kind = kind;
    bar.textContent = text;
  }
  const body = document.body.dataset;
  const status = values.status ?? {};
  body.link = kind === "lost" ? "lost" : "up";
  body.simulated = Boolean(status.simulated);
  body.recording = Boolean(status.recording);
  body.fault = Boolean(status.fault);
  body.batteryLow = Boolean(values.board?.battery_low);
}

export function startReadouts() {
  on("packet", refresh);
  on("connected", refresh);
  refresh();
}
