// Readouts and banner: each element with `data-field` shows the value of that field.

import { faultBlock, faultStart } from "./faults.js";
import { fixed } from "./numbers.js";
import { endRestart, restartText } from "./restart.js";
import { keyHint } from "./shortcuts.js";
import { on, state } from "./stream.js";

const LINK_LOST_S = 1.5; // without a message from the robot for this long, its link counts as lost
const GONE_S = 5; // and for this long, there is no robot
const NO_VALUE = "–";
const EXPERIMENTS = { identify: "identifying motors", tune: "tuning wheels" };
const SENSORS = ["camera", "gps", "imu"]; // of some robots; their parts of the page are hidden without them
const MOTORS = { armed: "armed; the wheels hold still", disarmed: "disarmed; the motors are off" }; // as answers say it
const ARMED = ["CLOSED_LOOP", "MANUAL"];
const DRIVEN_S = 1; // after this page's last manual command, the robot may still report it
const NEEDS_MAP = "[data-tool]:not([data-tool=pan], [data-tool=layers])";
const NEEDS_NO_FAULT = ["arm", "explore", "experiment"].map((name) => `[data-command*='"${name}"']`).join();
const CANCEL = `[data-command*='"cancel"']`;
const PAUSE = /^(waiting, |checking the charger|looking|choosing a frontier)/; // of a task whose motors are off meanwhile
const SENSOR_SILENT_S = 3; // a sensor that sent nothing for this long has no current value

const SENSOR_FIELDS = {
  gps_fix: ({ gps, sensor_age_s }) => gpsText(gps, sensor_age_s?.gps),
  gps_latitude: ({ gps }) => formatPlace(gps?.latitude_deg),
  gps_longitude: ({ gps }) => formatPlace(gps?.longitude_deg),
  gps_altitude: ({ gps }) => formatMetres(gps?.altitude_m),
  gps_age: ({ sensor_age_s }) => formatSeconds(sensor_age_s?.gps),
  imu_rate: ({ imu }) => formatDegrees(imu?.yaw_rate_rad_s, "°/s"),
  imu_roll: ({ imu }) => formatDegrees(imu?.roll_rad, "°"),
  imu_pitch: ({ imu }) => formatDegrees(imu?.pitch_rad, "°"),
  imu_acceleration: ({ imu }) => (imu?.acceleration_m_s2
    ? imu.acceleration_m_s2.map((part) => (isMissing(part) ? NO_VALUE : fixed(part, 1))).join(", ") : NO_VALUE),
  imu_age: ({ sensor_age_s }) => formatSeconds(sensor_age_s?.imu),
  camera_age: ({ sensor_age_s }) => (sensor_age_s?.camera > SENSOR_SILENT_S
    ? `no frame for ${sensor_age_s.camera.toFixed(0)} s` : ""),
};

// What a playback shows of the recording.
const DRAWN = new Set(["mode", "reason", "localization", "distance", "pose", "heading", ...Object.keys(SENSOR_FIELDS)]);

const isMissing = (value) => value === null || value === undefined;
const formatVolts = (volts) => (isMissing(volts) ? NO_VALUE : `${volts.toFixed(2)} V`);
const formatMetres = (metres) => (isMissing(metres) ? NO_VALUE : `${metres.toFixed(2)} m`);
const formatMs = (seconds) => (isMissing(seconds) ? NO_VALUE : `${(1000 * seconds).toFixed(0)} ms`);
const formatCount = (count) => (isMissing(count) ? NO_VALUE : count.toLocaleString("en-US").replaceAll(",", " "));

const formatPlace = (degrees) => (isMissing(degrees) ? NO_VALUE : `${degrees.toFixed(7)}°`);
const formatSeconds = (seconds) => (isMissing(seconds) ? NO_VALUE : `${seconds.toFixed(1)} s`);
const formatDegrees = (radians, unit, digits = 1) => (
  isMissing(radians) ? NO_VALUE : `${fixed((radians * 180) / Math.PI, digits)}${unit}`);

// RTK fix 0.02 m
function gpsText(gps, age_s) {
  if (!gps || age_s > SENSOR_SILENT_S) return "no data";
  return isMissing(gps.std_m) ? gps.fix : `${gps.fix} ${gps.std_m.toFixed(2)} m`;
}

const FIELDS = {
  ...SENSOR_FIELDS,
  first_run: ({ first_run: step }) => step ?? "",
  robot: ({ status }) => status?.robot ?? "",
  mode: ({ status, experiment }) => (experiment?.running
    ? EXPERIMENTS[experiment.running] ?? formatName(experiment.running)
    : isFaulted(status) ? "fault" : formatName(status?.mode)),
  reason: ({ status, experiment }) => (
    experiment?.running ? experiment.what : lostPose(status) || reasonText(status) || firstStep(status)),
  board_state: (values) => (isTuning(values) ? "tuning"
    : ARMED.includes(boardState(values)) ? "armed" : formatName(boardState(values))),
  localization: ({ status }) => (isPoseLost(status) ? "pose lost" : status?.localization ?? ""),
  lost_words: ({ status }) => (isPoseLost(status) ? "pose lost" : "searching for the pose"),
  battery: ({ board }) => formatVolts(board?.battery_V),
  distance: ({ status }) => (status?.has_goal ? formatMetres(status.distance_to_goal_m) : NO_VALUE),
  pose: ({ pose, status }) => (
    status?.pose_lost ? "lost" : pose ? `${fixed(pose[0], 2)}, ${fixed(pose[1], 2)} m` : NO_VALUE),
  heading: ({ pose, status }) => (status?.pose_lost ? NO_VALUE : formatDegrees(pose?.[2], "°", 0)),
  loop_late: ({ status }) => formatMs(status?.loop_late_s),
  loop_busy: ({ status }) => formatMs(status?.loop_busy_s),
  telemetry_age: ({ status }) => formatMs(status?.telemetry_age_s),
  scan_age: ({ status }) => formatMs(status?.scan_age_s),
  link_frames: ({ status }) => formatCount(status?.link_frames),
  link_errors: ({ status }) => formatCount(status?.link_errors),
  lost_edges: ({ status }) => formatCount(status?.lost_edges),
  lidar_scans: ({ status }) => formatCount(status?.lidar_scans),
  lidar_errors: ({ status }) => formatCount(status?.lidar_errors),
  lidar_restarts: ({ status }) => formatCount(status?.lidar_restarts),
  counts: ({ board }) => (board ? `${board.counts[0]}, ${board.counts[1]}` : NO_VALUE),
  gyro_state: ({ board }) => formatName(board?.gyroscope),
  gyro_heading: ({ board }) => formatDegrees(board?.gyro_heading_rad, "°"),
  pages: ({ pages }) => formatCount(pages),
  rtt: () => (state.rttMs === null ? NO_VALUE : `${state.rttMs.toFixed(0)} ms`),
  recorded: ({ recording_s, status }) => (status?.recording_paused ? "disk full" : formatDuration(recording_s)),
  fault_words: ({ status }) => (
    repeatsName(status) ? `${status.fault_cure}${isStop(status) ? withWhat() : ""}` : status?.fault_words ?? ""),
  fault_cure: ({ status }) => (repeatsName(status) ? "" : status?.fault_cure ?? ""),
  operator: ({ operator }) => (!operator ? "nobody" : operator === state.pageId ? "this page" : "another page"),
};

// What to do with a robot that has done nothing yet.
const firstStep = (status) => (status?.mode?.toLowerCase() === "idle" && !status.fault
  ? `choose Goal${keyHint("G")} and click the map, or Arm to drive` : "");

// " with Esc", if this page has stopped the robot.
const withWhat = () => (state.stopPressed ? ` with ${state.stopPressed}` : "");
const isFaulted = (status) => Boolean(status?.fault) && status.mode.toLowerCase() === "idle";
const isStop = (status) => status.fault_words === "emergency stop";
function reasonText(status) {
  if (status?.reason === "emergency stop" && state.stopPressed) return `emergency stop, pressed${withWhat()}`;
  const reason = MOTORS[status?.reason] ?? (status?.reason ?? "").replace(/^driven by teleop/, driver);
  const fault = faultStart(reason, status);
  return fault < 0 ? reason : reason.slice(0, fault); // the red box has the rest
}

// Pages and `thumper teleop` send the same messages.
const driver = () => (performance.now() - state.drivenMs < 1000 * DRIVEN_S
  ? "driven from this page" : "driven from another page or program");

// Why the pose is lost, unless the robot drives: then its own reason is the more useful one.
const lostPose = (status) => (status?.pose_lost && status.mode?.toLowerCase() !== "driving"
  ? `${isPoseLost(status) ? "pose lost" : "searching"}: ${status.pose_lost}` : "");

const isPoseLost = (status) => Boolean(status?.localization?.startsWith("pose lost")); // also "while mapping"

const isTuning = ({ board, status, experiment }) => Boolean(experiment?.running)
  && ARMED.includes(boardState({ board, status }));

const boardState = ({ board, status }) => board?.state ?? status?.board_state;

// LEFT_STALLED -> left stalled
function formatName(name) {
  return name ? name.toLowerCase().replaceAll("_", " ") : NO_VALUE;
}

function formatDuration(seconds) {
  if (isMissing(seconds)) return "";
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

// Return the banner's kind and text. `silent_s` is the time since the robot's last message; null before the first.
// A page without an `address` starts the robot itself; `world` is a simulated robot's.
function bannerContent({ status, silent_s }, address, world) {
  if (state.packets === 0) return ["lost", "Connecting to the dashboard server …"];
  if (!state.connected) return ["lost", "No connection to the dashboard server. Manual driving stops, a goal goes on."];
  if (isMissing(silent_s)) {
    return ["lost", address ? `No robot at ${address}; start \`thumper run\`.` : "No robot is running yet: step 4 starts it."];
  }
  if (silent_s > LINK_LOST_S) {
    const hint = address ? " Is `thumper run` still running?" : "";
    return ["lost", `No data from the robot for ${silent_s.toFixed(0)} s.${hint}`];
  }
  if (!status) return ["lost", "Waiting for the robot …"];
  if (state.playback) return ["playback", state.banner];
  return status.simulated
    ? ["simulated", world ? `Simulated robot: ${world}` : "Simulated robot"]
    : ["real", "Real robot: it can move at any time"];
}

function refresh() {
  const values = state.values;
  for (const element of document.querySelectorAll("[data-field]")) {
    const { field } = element.dataset;
    const text = String(FIELDS[field]?.(DRAWN.has(field) ? state.shown : values) ?? "");
    if (element.textContent !== text) element.textContent = text;
    if (field === "reason" && element.title !== text) element.title = text; // the line may cut it
  }
  const banner = document.getElementById("tp-banner");
  const [kind, usualText] = bannerContent(values, banner?.dataset.address, banner?.dataset.world);
  if (kind !== "lost") endRestart();
  const text = (kind === "lost" && restartText()) || usualText;
  if (banner && (banner.dataset.kind !== kind || banner.textContent !== text)) {
    banner.dataset.kind = kind;
    banner.textContent = text;
  }
  const flags = document.body.dataset; // the style sheet reads these
  const status = values.status ?? {};
  for (const name of SENSORS) flags[name] = name in (state.shown.sensor_age_s ?? {});
  flags.gyroscope = (values.board?.gyroscope ?? "OFF") !== "OFF";
  flags.link = kind === "lost" ? "lost" : "up";
  flags.simulated = Boolean(status.simulated);
  flags.recording = Boolean(status.recording);
  flags.poseLost = Boolean(state.shown.status?.pose_lost);
  flags.localization = (kind === "lost" ? "" : state.shown.status?.localization ?? "").replaceAll(" ", "_");
  flags.playback = Boolean(state.playback);
  flags.fault = Boolean(status.fault);
  flags.map = "map" in values;
  flags.goal = Boolean(state.shown.status?.has_goal);
  flags.board = (kind === "lost" ? "" : boardState(values) ?? "").toLowerCase();
  const isArmed = ARMED.map((name) => name.toLowerCase()).includes(flags.board);
  const isSilent = isMissing(values.silent_s) || values.silent_s > GONE_S;
  const isGone = Boolean(banner?.dataset.address) && state.connected && isSilent;
  for (const button of document.querySelectorAll("[data-command]")) button.disabled = isGone;
  for (const tool of document.querySelectorAll(NEEDS_MAP)) tool.disabled = isGone || !("map" in values);
  for (const button of document.querySelectorAll(NEEDS_NO_FAULT)) setInactive(button, faultBlock(values.status));
  for (const button of document.querySelectorAll(CANCEL)) setInactive(button, isAtRest(values) ? "Nothing is running" : "");
  document.querySelector(".tp-arm")?.setAttribute("aria-pressed", isArmed);
  flags.batteryLow = Boolean(values.board?.battery_low);
}

// Mark a button that can do nothing now with the reason; it keeps its place and takes the focus.
function setInactive(button, why) {
  if (why === (button.ariaDisabled ? button.title : "")) return;
  button.ariaDisabled = why ? "true" : null;
  button.title = why;
}

// Whether there is nothing to cancel.
function isAtRest({ status, experiment }) {
  return status?.mode?.toLowerCase() === "idle" && !status.has_goal && !experiment?.running && !PAUSE.test(status.reason);
}

// Whether the hint of a fault has its name in it, as in "the emergency stop was pressed".
function repeatsName(status) {
  return Boolean(status?.fault_words) && status.fault_cure.includes(status.fault_words);
}

export function startReadouts() {
  on("packet", refresh);
  on("connected", refresh);
  on("playback", refresh);
  refresh();
}
