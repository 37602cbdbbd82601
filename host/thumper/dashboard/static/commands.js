// Command buttons and the emergency stop (button, Space; Esc if there is nothing to cancel).
// An element with `data-command` sends the JSON message in that attribute on click; one that a fault blocks says why.

import { beep } from "./beep.js";
import { faultBlock, faultStart } from "./faults.js";
import { noteRestart } from "./restart.js";
import { on, send, state } from "./stream.js";

const NOTICE_MS = { good: 4000, bad: 6000 };
const MAX_NOTICES = 3;
const LINES = ".tp-reason, .tg-outcome, .tg-result"; // where the page says what happens, for as long as it is true
const FAULT = ".tp-fault, .tg-fault";
const EXPLORATION_ENDS = /^not back at the start: |^explored: |; back at the start$/;
const OPEN_SELECT = ".q-menu, .q-dialog"; // Quasar closes these on Esc by itself

const PHONE = window.matchMedia("(max-width: 560px)");

const WAITING_STOP = "tp-waiting-stop";
let answeredBy = Infinity; // the number of the heartbeat whose answer shows that the stop has arrived
const ESC_PAUSE_MS = 500; // after an Esc that closed something, one more is no emergency stop
const cancellers = [];
let closedMs = -Infinity;

// Add a function that cancels what the user has begun, and returns whether there was anything. Esc calls it.
export function onCancel(cancel) {
  cancellers.push(cancel);
}

// Whether a key goes into a text or a list, and so is no shortcut. A checkbox and a slider take no letters.
export function isTyping({ target }) {
  return Boolean(target.matches?.("textarea, select, input:not([type=checkbox], [type=radio], [type=range])"));
}

// Whether Space goes into a text instead of stopping the robot: only while the motors are known to be off.
function isSpaceText({ target }) {
  return ["disarmed", "fault"].includes(document.body.dataset.board)
    && Boolean(target.matches?.("textarea, input[type=text]"));
}

function cancelled() {
  const done = cancellers.map((cancel) => cancel());
  return done.includes(true) || document.querySelector(OPEN_SELECT) !== null;
}

// Stop the robot; `pressed` says with what, for who pressed it by accident.
export function emergencyStop(pressed) {
  sendStop();
  state.stopPressed = pressed;
  sessionStorage.setItem(WAITING_STOP, "true"); // survives that the page loads again, with its server
  document.body.classList.add("tp-stopped");
  setTimeout(() => document.body.classList.remove("tp-stopped"), 600);
  if (state.connected) return;
  notify("No connection: the emergency stop waits for it. A goal goes on: cut the power, or run `thumper stop`.", "bad");
}

// A socket takes messages for minutes after its network is cut. So the stop waits until the server has answered a
// heartbeat that was sent after it.
function sendStop() {
  answeredBy = send({ kind: "estop" }) ? state.heartbeats + 1 : Infinity;
}

function sendWaitingStop() {
  if (sessionStorage.getItem(WAITING_STOP) === null) return;
  sendStop();
  notify("The emergency stop was sent.", "good");
}

export function notify(text, kind) {
  const list = document.getElementById("tp-notices");
  if (!list) return;
  for (const old of [...list.children]) if (old.dataset.text === text) old.remove(); // said again
  const notice = list.appendChild(document.createElement("div"));
  notice.className = `tp-notice ${kind}`;
  notice.dataset.text = notice.textContent = text;
  if (text.startsWith("another page controls the robot")) {
    const take = notice.appendChild(document.createElement("button"));
    Object.assign(take, { type: "button", className: "tp-plain", textContent: "Take control" });
    take.dataset.takeControl = "";
    take.addEventListener("click", () => notice.remove());
  }
  while (list.children.length > MAX_NOTICES) list.firstChild.remove();
  setTimeout(() => notice.remove(), NOTICE_MS[kind]);
}

// Remove notices whose text stands in a line or the box of a fault, where the user can see it.
function removeRepeated() {
  const lines = [...document.querySelectorAll(LINES)].filter(isInView).map((line) => line.textContent.toLowerCase());
  const hasFault = [...document.querySelectorAll(FAULT)].some(isInView);
  for (const notice of document.querySelectorAll(".tp-notice")) {
    const { text } = notice.dataset;
    const isFault = hasFault && faultStart(text, state.values.status) >= 0;
    if (isFault || lines.some((line) => line.includes(text.toLowerCase()))) notice.remove();
  }
}

function isInView(element) {
  const { top, bottom, height } = element.getBoundingClientRect();
  return height > 0 && top >= 0 && bottom <= window.innerHeight;
}

// Remove notices that are true no longer.
function removeNotices(start) {
  for (const notice of document.querySelectorAll(".tp-notice")) if (notice.textContent.startsWith(start)) notice.remove();
}

function showLocalization(now, reason) {
  removeNotices("pose ");
  if (now === "localized") notify("pose found: the robot is localized in the map", "good");
  if (now.startsWith("pose lost")) notify(`pose lost: ${reason}`, "bad");
}

export function startCommands() {
  on("connected", (connected) => { if (connected) sendWaitingStop(); });
  on("server:beat", ({ n }) => { if (n >= answeredBy) sessionStorage.removeItem(WAITING_STOP); });
  // Listen in the capture phase: a focused button or field must not consume the stop key.
  document.addEventListener("keydown", (event) => {
    if (event.code === "Space" && isSpaceText(event)) return;
    if (event.code === "Space") event.preventDefault();
    if (event.repeat) return; // an Esc that is held cancels once, and does not stop the robot as well
    if (event.code === "Space") emergencyStop("Space");
    if (event.code !== "Escape") return;
    if (cancelled()) closedMs = event.timeStamp;
    else if (event.timeStamp - closedMs > ESC_PAUSE_MS) emergencyStop("Esc");
  }, true);
  document.addEventListener("keyup", (event) => {
    if (event.code === "Space") event.preventDefault(); // a focused button fires when Space is released
  }, true);
  document.addEventListener("pointerdown", (event) => {
    if (event.target.closest?.("[data-estop]")) emergencyStop("the STOP button"); // stop on press, not on release
  }, true);
  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("[data-command]");
    if (!button) return;
    const blocked = faultBlock(state.values.status);
    if (blocked && button.title === blocked) notify(blocked, "bad");
    else if (!send(JSON.parse(button.dataset.command))) {
      notify("No connection to the dashboard server: the command was not sent.", "bad");
    }
  });
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-take-control]")) send({ kind: "take_control" });
  });
  document.addEventListener("click", (event) => {
    if (!event.target.closest?.("[data-record]")) return;
    send({ kind: "command", name: state.values.status?.recording ? "record_stop" : "record_start" });
  });
  on("operator", (operator) => {
    document.body.classList.toggle("tp-watching", Boolean(operator) && operator !== state.pageId);
  });
  let isSnapshot = false; // its events are old
  let hadFault = false;
  let block = ""; // what a blocked button says
  on("snapshot", () => { isSnapshot = true; });
  on("packet", () => {
    isSnapshot = false;
    const hasFault = Boolean(state.values.status?.fault);
    if (hasFault && !hadFault) {
      document.querySelectorAll(".tp-notice.good").forEach((notice) => notice.remove());
      // Each fault says once what to do; on a phone it would cover the robot.
      document.querySelector(".tp-fault details")?.toggleAttribute("open", !PHONE.matches);
    }
    if (hadFault && !hasFault) {
      state.stopPressed = "";
      if (block) removeNotices(block);
    }
    block = faultBlock(state.values.status);
    hadFault = hasFault;
    if (["closed_loop", "manual"].includes(document.body.dataset.board)) removeNotices("fault cleared");
    if (document.querySelector(".tp-notice")) removeRepeated();
  });
  on("events", (events) => {
    for (const { text } of isSnapshot ? [] : events) {
      if (text.startsWith("beep at ")) beep();
      noteRestart(text);
      if (/^(map saved|the map was not saved): /.test(text)) removeNotices("saving the map");
      if (text.startsWith("map saved: ")) notify(text, "good");
      if (/^the (map was not saved|pose was not set): |^the scans contradict/.test(text)) notify(text, "bad");
      if (EXPLORATION_ENDS.test(text)) {
        removeNotices("exploring");
        notify(text, text.startsWith("not back") ? "bad" : "good");
      }
    }
  });
  let localization = "";
  on("packet", () => { // of the robot: during a playback `status` is the recording's
    const { localization: now = "", pose_lost: reason } = state.values.status ?? {};
    if (now === localization) return;
    if (localization) showLocalization(now, reason);
    localization = now;
  });
  on("server:refused", ({ text }) => notify(text, "bad"));
  on("server:note", ({ text }) => notify(text, "good"));
}
