// The one connection to the server: packets in, orders out, and the heartbeat that lets the robot move.

const HEARTBEAT_MS = 100;
const RETRY_MS = [200, 500, 1000, 2000];
const STALE_MS = 1500; // no packet for so long: the picture is old, whatever the socket says
const EVENTS_KEPT = 100; // for the log, which is there only once its tab has been opened

const listeners = new Map(); // name -> functions; a name is a key of a packet, or one of the events below
export const state = { connected: false, me: "", packets: 0, rttMs: null, values: {} };

let socket = null;
let tries = 0;
let lastPacketMs = 0;
let beat = 0;
const beatSent = new Map();

export function on(name, listener) {
  if (!listeners.has(name)) listeners.set(name, new Set());
  listeners.get(name).add(listener);
  if (name in state.values) listener(state.values[name]); // who comes late is told what is
  return () => listeners.get(name).delete(listener);
}

function tell(name, value) {
  for (const listener of listeners.get(name) ?? []) listener(value);
}

export function send(order) {
  if (socket?.readyState !== WebSocket.OPEN) return false;
  socket.send(JSON.stringify(order));
  return true;
}

// A packet: length of the header, header (JSON), arrays; see packet.py.
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

function take(buffer) {
  const { header, arrays } = decode(buffer);
  lastPacketMs = performance.now();
  state.packets += 1;
  if (header.whole) { // all there is: its events are no news, and what was kept may be of another run
    delete header.whole;
    delete state.values.events;
    tell("whole", null);
  }
  const all = { ...header };
  for (const [name, array] of Object.entries(arrays)) {
    all[name] = name in header ? { place: header[name], cells: array } : array;
  }
  for (const [name, value] of Object.entries(all)) {
    if (name === "events") state.values.events = [...(state.values.events ?? []), ...value].slice(-EVENTS_KEPT);
    else if (name !== "wheels") state.values[name] = value;
    tell(name, value);
  }
  tell("packet", header);
}

function takeText(text) {
  const message = JSON.parse(text);
  if (message.kind === "hello") state.me = message.me;
  if (message.kind === "beat" && beatSent.has(message.n)) {
    state.rttMs = performance.now() - beatSent.get(message.n);
    beatSent.clear();
  }
  tell(`server:${message.kind}`, message);
}

function setConnected(connected) {
  if (state.connected === connected) return;
  state.connected = connected;
  tell("connected", connected);
}

function connect() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  socket = new WebSocket(`${scheme}://${location.host}/stream`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    tries = 0;
    tell("fresh", null); // what was kept belongs to another run of the server
  };
  socket.onmessage = (event) => {
    if (typeof event.data === "string") takeText(event.data);
    else take(event.data);
    setConnected(true);
  };
  socket.onclose = () => {
    setConnected(false);
    setTimeout(connect, RETRY_MS[Math.min(tries++, RETRY_MS.length - 1)]);
  };
}

export function start() {
  connect();
  setInterval(() => {
    if (lastPacketMs && performance.now() - lastPacketMs > STALE_MS) setConnected(false);
    if (document.hidden) return; // a page that nobody sees drives no robot
    beat += 1;
    beatSent.set(beat, performance.now());
    if (beatSent.size > 50) beatSent.clear();
    send({ kind: "heartbeat", n: beat });
  }, HEARTBEAT_MS);
}
