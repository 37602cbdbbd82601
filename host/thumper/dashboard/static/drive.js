// Driving by hand: a stick on the page, and a gamepad of the browser. Hold to drive; letting go is a zero.

import { on, send, state } from "./stream.js";

const PERIOD_MS = 50;
const DEAD = 0.1;
const EXPO = 0.3;
const PAD = { forward: 1, turn: 2, hold: 4, turbo: 5, stop: 1, arm: 9 }; // of the standard mapping

function shaped(value) {
  const size = Math.abs(value);
  if (size < DEAD) return 0;
  const rest = (size - DEAD) / (1 - DEAD);
  return Math.sign(value) * ((1 - EXPO) * rest + EXPO * rest ** 3);
}

class Drive {
  constructor(root) {
    this.stick = null; // [forward, left] while held
    this.turbo = false;
    this.driving = false;
    this.mustLetGo = true; // the pad's button must be seen up before it counts
    this.pressed = new Set();
    this.build(root);
    setInterval(() => this.tick(), PERIOD_MS);
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.release(); });
    window.addEventListener("blur", () => this.release());
    window.addEventListener("pagehide", () => this.release());
    on("connected", (connected) => { if (!connected) this.release(); });
  }

  build(root) {
    root.innerHTML = `
      <div class="tp-stick" role="slider" aria-label="drive stick" tabindex="-1"><div class="tp-knob"></div></div>
      <div class="tp-stickside">
        <label class="tp-check"><input type="checkbox"> Turbo</label>
        <div class="tp-speeds"><span></span><span></span></div>
        <div class="tp-pad"></div>
      </div>`;
    this.area = root.querySelector(".tp-stick");
    this.knob = root.querySelector(".tp-knob");
    this.speeds = root.querySelectorAll(".tp-speeds span");
    this.pad = root.querySelector(".tp-pad");
    root.querySelector("input").addEventListener("change", (event) => {
      this.turbo = event.target.checked;
      event.target.blur();
    });
    this.area.addEventListener("pointerdown", (event) => {
      this.area.setPointerCapture(event.pointerId);
      this.moveStick(event);
    });
    this.area.addEventListener("pointermove", (event) => { if (this.stick) this.moveStick(event); });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      this.area.addEventListener(end, () => this.release());
    }
  }

  moveStick(event) {
    const box = this.area.getBoundingClientRect();
    const radius = box.width / 2;
    let dx = (event.clientX - box.left - radius) / (0.7 * radius);
    let dy = (event.clientY - box.top - radius) / (0.7 * radius);
    const long = Math.hypot(dx, dy);
    if (long > 1) [dx, dy] = [dx / long, dy / long];
    this.stick = [-dy, -dx];
    this.knob.style.transform = `translate(${35 * dx}%, ${35 * dy}%)`;
    this.knob.style.setProperty("--dx", dx);
    this.knob.style.setProperty("--dy", dy);
  }

  release() {
    this.stick = null;
    this.knob.style.setProperty("--dx", 0);
    this.knob.style.setProperty("--dy", 0);
    if (this.driving) this.order(0, 0, false);
    this.driving = false;
    this.mustLetGo = true;
  }

  gamepad() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((one) => one?.connected);
    const down = (button) => Boolean(pad?.buttons[button]?.pressed);
    this.onPress("stop", down(PAD.stop), { kind: "estop" }); // whatever has the focus
    // Without the focus a browser may go on showing the pad as it was: a stick that never comes back.
    if (!pad || document.hidden || !document.hasFocus()) {
      this.pad.textContent = pad ? "Click this page to drive with the gamepad" : "No gamepad: press a button of it";
      this.mustLetGo = true;
      return null;
    }
    this.onPress("arm", down(PAD.arm), { kind: "command", name: "arm" });
    this.pad.textContent = `${pad.id.slice(0, 24)}: ${down(PAD.hold) ? "driving" : "hold LB to drive"}`;
    if (!down(PAD.hold)) this.mustLetGo = false;
    if (!down(PAD.hold) || this.mustLetGo) return null;
    return [-pad.axes[PAD.forward], -pad.axes[PAD.turn], down(PAD.turbo)];
  }

  onPress(name, isDown, order) {
    if (isDown && !this.pressed.has(name)) send(order);
    if (isDown) this.pressed.add(name);
    else this.pressed.delete(name);
  }

  tick() {
    const pad = this.gamepad();
    const held = this.stick ? [...this.stick, this.turbo] : pad;
    if (held) {
      this.driving = true;
      this.order(shaped(held[0]), shaped(held[1]), held[2]);
    } else if (this.driving) {
      this.release();
    }
  }

  order(forward, left, turbo) {
    send({ kind: "teleop", forward, left, turbo });
    const limits = state.values.limits;
    if (!limits) return;
    const share = turbo ? 1 : limits.slow;
    this.speeds[0].textContent = `${(forward * share * limits.v_m_s).toFixed(2)} m/s`;
    this.speeds[1].textContent = `${(left * share * limits.w_rad_s).toFixed(2)} rad/s`;
  }
}

export function drive(root) {
  root.drive = new Drive(root);
}
