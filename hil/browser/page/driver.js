// Keys and a touch stick: who holds one drives.

const SPEED_M_S = 0.5, TURN_RAD_S = 1.6;
const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0], ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowLeft: [0, 1], KeyA: [0, 1], ArrowRight: [0, -1], KeyD: [0, -1],
};

/** Call `drive(twist)` with each wanted motion while keys are held in `area` or the stick is moved, `stop()` at Space. */
export function listen(area, stick, { drive, stop }) {
  const held = new Set();
  const send = (ahead, left) => drive({ v_m_s: ahead * SPEED_M_S, w_rad_s: left * TURN_RAD_S });
  const sendKeys = () => {
    const directions = [...held].map((code) => KEYS[code]);
    const sum = (i) => Math.max(-1, Math.min(1, directions.reduce((total, direction) => total + direction[i], 0)));
    send(sum(0), sum(1));
  };
  area.addEventListener("keydown", (event) => {
    if (event.code === "Space" && !(event.target instanceof HTMLButtonElement)) {  // which it presses
      event.preventDefault();  // it would scroll the page
      held.clear();
      stop();
    }
    if (!(event.code in KEYS) || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLInputElement && event.code.startsWith("Arrow")) return;  // they move a slider
    event.preventDefault();
    event.stopPropagation();  // the site has keys of its own
    held.add(event.code);
    sendKeys();
  });
  const release = (event) => {
    if (held.delete(event.code)) sendKeys();
  };
  window.addEventListener("keyup", release);
  area.addEventListener("focusout", () => {
    if (held.size === 0) return;
    held.clear();
    sendKeys();
  });
  listenToStick(stick, send);
}

function listenToStick(stick, send) {
  const knob = stick.firstElementChild;
  const move = (x, y) => {
    knob.style.transform = `translate(${x}px, ${y}px)`;
  };
  const point = (event) => {
    const { left, top, width } = stick.getBoundingClientRect();
    const radius = width / 2;
    const x = event.clientX - left - radius, y = event.clientY - top - radius;
    const shrink = Math.min(1, (0.7 * radius) / Math.hypot(x, y));
    move(x * shrink, y * shrink);
    send((-y * shrink) / (0.7 * radius), (-x * shrink) / (0.7 * radius));
  };
  stick.addEventListener("pointerdown", (event) => {
    stick.setPointerCapture(event.pointerId);
    point(event);
  });
  stick.addEventListener("pointermove", (event) => {
    if (stick.hasPointerCapture(event.pointerId)) point(event);
  });
  for (const end of ["pointerup", "pointercancel"])
    stick.addEventListener(end, () => {
      move(0, 0);
      send(0, 0);
    });
}
