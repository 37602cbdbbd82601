// Manual driving: an on-screen joystick, keys and the browser's gamepad. All drive only while they are held;
// a release sends zero speed.

import { emergencyStop, isTyping } from "./commands.js";
import { faultBlock } from "./faults.js";
import { on, send, state } from "./stream.js";

const PERIOD_MS = 50;
const DEADBAND = 0.1;
const EXPO = 0.3; // share of the cubic term
const KNOB_TRAVEL = 0.7; // of the joystick's radius
const AXES = { forward: 1, turn: 2 }; // indices of the browser's standard gamepad mapping
const KEYS = { // right and down
  w: [0, -1], a: [-1, 0], s: [0, 1], d: [1, 0],
  arrowup: [0, -1], arrowleft: [-1, 0], arrowdown: [0, 1], arrowright: [1, 0],
};
// Here an arrow key has a meaning of its own, as on the map, which prevents its default.
const TAKES_ARROWS = "select, input[type=range], .q-tabs, .q-menu";
const BUTTONS = { deadman: 4, turbo: 5, stop: 1, override: 2, arm: 9 };

// Joystick curve: deadband, then linear plus cubic (fine control at low speed).
function applyCurve(value) {
  const magnitude = Math.abs(value);
  if (magnitude < DEADBAND) return 0;
  const scaled = (magnitude - DEADBAND) / (1 - DEADBAND);
  return Math.sign(value) * ((1 - EXPO) * scaled + EXPO * scaled ** 3);
}

class ManualDrive {
  constructor(root) {
    this.joystick = null; // [forward, left] while held
    this.keys = new Set(); // those that are down
    this.turbo = false;
    this.shift = false;
    this.override = false; // drive although something is in the way, while its button or Shift is held
    this.driving = false;
    this.mustRelease = true; // ignore the gamepad's deadman button until it was seen released
    this.pressed = new Set();
    this.build(root);
    setInterval(() => this.update(), PERIOD_MS);
    for (const [name, isDown] of [["keydown", true], ["keyup", false]]) {
      window.addEventListener(name, (event) => { if (event.key === "Shift") this.shift = isDown; });
    }
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.release(); });
    window.addEventListener("blur", () => {
      this.shift = false;
      this.release();
    });
    window.addEventListener("pagehide", () => this.release());
    on("connected", (connected) => { if (!connected) this.release(); });
    on("packet", () => this.showBlock(state.values.status)); // also in a playback, whose status is another
  }

  build(root) {
    root.innerHTML = `
      <div class="tp-stick" role="application" aria-label="joystick: hold W, A, S, D or arrow keys to drive" tabindex="0"><div class="tp-knob"></div><b></b></div>
      <div class="tp-stickside">
        <label class="tp-check"><input type="checkbox"> Turbo</label>
        <button type="button" class="tp-override" title="Hold this button or Shift to drive although something is in the way">Hold: ignore obstacles</button>
        <div class="tp-speeds" title="What you ask for. The floor slows the wheels, most in turns: the charts show their speeds"><span></span><span></span></div>
        <div class="tp-pad"></div>
      </div>`;
    this.area = root.querySelector(".tp-stick");
    this.knob = root.querySelector(".tp-knob");
    this.speeds = root.querySelectorAll(".tp-speeds span");
    this.block = root.querySelector(".tp-stick b");
    this.gamepadStatus = root.querySelector(".tp-pad");
    root.querySelector("input").addEventListener("change", (event) => {
      this.turbo = event.target.checked;
      event.target.blur();
    });
    const override = root.querySelector(".tp-override");
    override.addEventListener("pointerdown", () => { this.override = true; });
    for (const name of ["pointerup", "pointercancel", "pointerleave"]) {
      override.addEventListener(name, () => { this.override = false; });
    }
    this.area.addEventListener("pointerdown", (event) => {
      this.area.setPointerCapture(event.pointerId);
      this.moveJoystick(event);
    });
    this.addKeys();
    this.area.addEventListener("pointermove", (event) => { if (this.joystick) this.moveJoystick(event); });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
      this.area.addEventListener(name, () => this.release());
    }
  }

  // While the joystick is shown, its keys drive as long as they are held.
  addKeys() {
    document.addEventListener("keydown", (event) => {
      const key = event.key.toLowerCase();
      if (!this.isDriveKey(event, key)) return;
      event.preventDefault();
      if (event.repeat) return; // after a release by other means, a key that is still down must not drive
      this.keys.add(key);
      this.moveByKeys();
    });
    document.addEventListener("keyup", (event) => {
      if (!this.keys.delete(event.key.toLowerCase())) return;
      if (this.keys.size) this.moveByKeys();
      else this.release();
    });
    this.area.addEventListener("blur", () => { if (this.keys.size) this.release(); });
  }

  isDriveKey(event, key) {
    if (!(key in KEYS) || event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return false;
    if (isTyping(event) || !this.area.checkVisibility()) return false;
    return !(key.startsWith("arrow") && event.target.closest?.(TAKES_ARROWS));
  }

  moveByKeys() {
    const sum = [0, 1].map((axis) => [...this.keys].reduce((total, key) => total + KEYS[key][axis], 0));
    this.setJoystick(...sum.map((part) => Math.max(-1, Math.min(1, part))));
  }

  moveJoystick(event) {
    const box = this.area.getBoundingClientRect();
    const radius = box.width / 2;
    let dx = (event.clientX - box.left - radius) / (KNOB_TRAVEL * radius);
    let dy = (event.clientY - box.top - radius) / (KNOB_TRAVEL * radius);
    const length = Math.hypot(dx, dy);
    if (length > 1) [dx, dy] = [dx / length, dy / length];
    this.setJoystick(dx, dy);
  }

  // Deflect the joystick: right and down, 1 at most.
  setJoystick(dx, dy) {
    this.joystick = [-dy, -dx];
    this.knob.style.setProperty("--dx", dx);
    this.knob.style.setProperty("--dy", dy);
  }

  release() {
    this.joystick = null;
    this.keys.clear();
    this.override = false;
    this.knob.style.setProperty("--dx", 0);
    this.knob.style.setProperty("--dy", 0);
    if (this.driving) this.sendTeleop(0, 0, false);
    this.driving = false;
    this.mustRelease = true;
  }

  // Return [forward, left, turbo] while the gamepad drives, else null. Handles its stop and arm buttons.
  readGamepad() {
    const gamepad = [...(navigator.getGamepads?.() ?? [])].find((candidate) => candidate?.connected);
    const isDown = (button) => Boolean(gamepad?.buttons[button]?.pressed);
    this.onPress("stop", isDown(BUTTONS.stop), () => emergencyStop("the gamepad")); // works without the focus, too
    // Without the focus a browser may keep reporting the last state of the gamepad: a stick that never returns.
    this.gamepadStatus.dataset.found = Boolean(gamepad);
    if (!gamepad || document.hidden || !document.hasFocus()) {
      this.showGamepad(gamepad ? "Click this page to drive with the gamepad"
        : "Gamepad: press a button to connect it");
      this.mustRelease = true;
      return null;
    }
    this.onPress("arm", isDown(BUTTONS.arm), () => send({ kind: "command", name: "arm" }));
    const held = isDown(BUTTONS.deadman);
    this.showGamepad(`${gamepad.id.slice(0, 24)}: ${held ? "driving" : "hold LB to drive"}`);
    if (!held) this.mustRelease = false;
    if (!held || this.mustRelease) return null;
    return [-gamepad.axes[AXES.forward], -gamepad.axes[AXES.turn], isDown(BUTTONS.turbo), isDown(BUTTONS.override)];
  }

  // Show on the joystick what to do before it drives.
  showBlock(status) {
    const text = ["disarmed", "fault"].includes(status?.board_state?.toLowerCase())
      ? (faultBlock(status) && "Clear the fault first") || "Press Arm first" : "";
    if (this.block.textContent !== text) this.block.textContent = text;
  }

  // Setting the same text again would lay out the page again.
  showGamepad(text) {
    if (this.gamepadStatus.textContent !== text) this.gamepadStatus.textContent = text;
  }

  onPress(name, isDown, act) {
    if (isDown && !this.pressed.has(name)) act();
    if (isDown) this.pressed.add(name);
    else this.pressed.delete(name);
  }

  update() {
    if (this.keys.size && !this.area.checkVisibility()) this.release();
    const gamepad = this.readGamepad();
    const input = this.joystick ? [...this.joystick, this.turbo, this.override || this.shift] : gamepad;
    if (input) {
      this.driving = true;
      this.sendTeleop(applyCurve(input[0]), applyCurve(input[1]), input[2], input[3]);
    } else if (this.driving) {
      this.release();
    }
  }

  sendTeleop(forward, left, turbo, override = false) {
    send({ kind: "teleop", forward, left, turbo, override: Boolean(override) });
    state.drivenMs = performance.now();
    const limits = state.values.limits;
    if (!limits) return;
    const scale = turbo ? 1 : limits.slow;
    if (!state.values.status || this.block.textContent) {
      for (const speed of this.speeds) speed.textContent = "";
      return;
    }
    this.speeds[0].textContent = `asked: ${(forward * scale * limits.v_m_s).toFixed(2)} m/s`;
    this.speeds[1].textContent = `${(left * scale * limits.w_rad_s).toFixed(2)} rad/s`;
  }
}

export function drive(root) {
  root.manualDrive = new ManualDrive(root);
}
