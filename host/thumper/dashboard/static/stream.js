// The websocket to the server: receives packets, sends messages, and heartbeats without which tuning stops.

import { GridImage } from "./grid_image.js";

const HEARTBEAT_MS = 50;
const RETRY_MS = [200, 500, 1000, 2000];
const STALE_MS = 1500; // without a packet for this long the display is outdated, even if the socket is open
const MAX_PENDING_HEARTBEATS = 50;
const MAX_EVENTS = 100; // kept for the log, which exists only after its tab was opened

// What a playback shows of the recording instead of the robot. All else stays live.
const DRAWN = new Set(["annotations", "camera", "gps", "gps_odom", "imu", "local_costmap", "local_plan", "map",
  "objects", "particles", "plan", "pose", "scan", "sensor_age_s", "status", "trail", "wheels"]);
const MAX_ROWS = 1200;
const GRIDS = ["map", "local_costmap"];

// Event name -> listeners. An event is a key of a packet, `packet`, `snapshot`, `connected`, `opened`, `playback`
// or `server:` and the kind of a text message.
const listeners = new Map();
// `values` are the robot's; `shown` are those on the map: of the recording or saved map `playback`, else the robot's.
// `heartbeats` is the number of the newest heartbeat sent, `stopPressed` what this page stopped the robot with,
// `drivenMs` when it last sent a manual command.
export const state = {
  connected: false, pageId: "", packets: 0, heartbeats: 0, rttMs: null, values: {}, playback: "", banner: "",
  stopPressed: "", drivenMs: -Infinity,
};
state.shown = state.values;

let socket = null;
let retries = 0;
let lastPacketMs = 0;
let rowsMeanwhile = []; // of the charts, during a playback
const heartbeatSentMs = new Map(); // heartbeat number -> time

export function on(name, listener) {
  if (!listeners.has(name)) listeners.set(name, new Set());
  listeners.get(name).add(listener);
  const values = DRAWN.has(name) ? state.shown : state.values;
  if (name in values) listener(values[name]); // a late listener gets the current value at once
  return () => listeners.get(name).delete(listener);
}

function emit(name, value) {
  for (const listener of listeners.get(name) ?? []) listener(value);
}

// Send a message; return false if there is no connection. Any command ends a playback: what follows is live.
export function send(message) {
  if (message.kind !== "heartbeat") showRobot();
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(message));
  return true;
}

// Binary packet: header length (uint32, little-endian), header (JSON), arrays. The server's
// `encode_packet` defines the format.
export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const body = 4 + length;
  const arrays = {};
  for (const [name, [offset, count, kind]] of Object.entries(header.arrays)) {
    arrays[name] = kind === "f4" ? new Float32Array(buffer, body + offset, count)
      : new Uint8Array(buffer, body + offset, count);
  }
  delete header.arrays;
  return { header, arrays };
}

// Return what a packet changes; a patch of a grid continues the one `before`.
function valuesOf({ header, arrays }, before) {
  const values = { ...header };
  for (const [name, array] of Object.entries(arrays)) {
    values[name] = name in header ? { info: header[name], image: array } : array;
  }
  for (const name of GRIDS) {
    if (!(name in values)) continue;
    const grid = values[name].info.patch ? before[name] : new GridImage(name);
    grid.add(values[name]);
    values[name] = grid;
  }
  return values;
}

function handlePacket(buffer) {
  const packet = decode(buffer);
  lastPacketMs = performance.now();
  state.packets += 1;
  if (packet.header.whole) { // a snapshot repeats events that we may already have, or comes from another run
    delete packet.header.whole;
    delete state.values.events;
    emit("snapshot", null);
  }
  for (const [name, value] of Object.entries(valuesOf(packet, state.values))) {
    if (name === "events") state.values.events = [...(state.values.events ?? []), ...value].slice(-MAX_EVENTS);
    else if (name !== "wheels") state.values[name] = value;
    if (!state.playback || !DRAWN.has(name)) emit(name, value);
    else if (name === "wheels") rowsMeanwhile = [...rowsMeanwhile, ...value].slice(-MAX_ROWS);
  }
  emit("packet", packet.header);
}

// Show a recording or saved map from here on: its packets replace the robot's data. Called again after a jump in time.
export function startPlayback(name, banner) {
  state.playback = name;
  state.banner = banner;
  state.shown = { annotations: { features: [] } };
  emit("playback", name);
}

// Show a decoded packet of the recording.
export function playPacket(packet) {
  for (const [name, value] of Object.entries(valuesOf(packet, state.shown))) {
    if (!DRAWN.has(name)) continue;
    if (name !== "wheels") state.shown[name] = value;
    emit(name, value);
  }
}

// End the playback: show the robot as it is now.
export function showRobot() {
  if (!state.playback) return;
  state.playback = "";
  state.shown = state.values;
  emit("playback", "");
  for (const name of DRAWN) if (name !== "trail" && name in state.values) emit(name, state.values[name]);
  if (rowsMeanwhile.length) emit("wheels", rowsMeanwhile);
  rowsMeanwhile = [];
}

function handleText(text) {
  const message = JSON.parse(text);
  if (message.kind === "hello") state.pageId = message.me;
  if (message.kind === "beat" && heartbeatSentMs.has(message.n)) {
    state.rttMs = performance.now() - heartbeatSentMs.get(message.n);
    heartbeatSentMs.clear();
  }
  emit(`server:${message.kind}`, message);
}

function setConnected(connected) {
  if (state.connected === connected) return;
  state.connected = connected;
  if (!connected) state.rttMs = null;
  emit("connected", connected);
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/stream`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    retries = 0;
    emit("opened", null); // the server may have restarted: data from before the connection is outdated
  };
  socket.onmessage = (event) => {
    if (typeof event.data === "string") handleText(event.data);
    else handlePacket(event.data);
    setConnected(true);
  };
  socket.onclose = () => {
    setConnected(false);
    setTimeout(connect, RETRY_MS[Math.min(retries++, RETRY_MS.length - 1)]);
  };
}

function sendHeartbeat() {
  if (lastPacketMs && performance.now() - lastPacketMs > STALE_MS) setConnected(false);
  if (document.hidden) return; // a hidden page must not keep an experiment going
  state.heartbeats += 1;
  heartbeatSentMs.set(state.heartbeats, performance.now());
  if (heartbeatSentMs.size > MAX_PENDING_HEARTBEATS) heartbeatSentMs.clear();
  send({ kind: "heartbeat", n: state.heartbeats });
}

export function startStream() {
  connect();
  setInterval(sendHeartbeat, HEARTBEAT_MS);
}
