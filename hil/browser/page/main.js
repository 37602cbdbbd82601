// The robot on the site's front page: fills the element #robot and starts.
import faults from "../build/faults.json";
import params from "../build/robot.json";
import schema from "../build/protocol.json";
import hex from "../../../firmware/build/thumper.hex";
import { SIZE_M } from "../room.js";
import { Simulation } from "../simulation.js";
import { listenToBreaks, showBreaks } from "./breaks.js";
import { Chart } from "./chart.js";
import { run } from "./clock.js";
import { listen } from "./driver.js";
import { addGains } from "./gains.js";
import { hint } from "./hint.js";
import { RoomView } from "./room_view.js";
import panel from "./panel.html";

const LINK = "#drive-it-here";
const STATES = { DISARMED: "disarmed", CLOSED_LOOP: "armed", MANUAL: "manual", FAULT: "fault" };
const STATE_TITLES = { CLOSED_LOOP: "The controllers drive the motors", MANUAL: "The motors are driven without controllers" };

/** Build the panel in an element and run the robot in it. */
function start(element) {
  element.innerHTML = panel;
  const find = (selector) => element.querySelector(selector);
  const simulation = new Simulation({ hex, params, schema });
  const room = new RoomView(find(".robot-room"), params.outline);
  const charts = chartsOf(find);
  element.simulation = simulation;  // for tests, and for those who look

  addGains(find(".robot-gains"), simulation.protocol, (name, value) => simulation.link.setParameter(name, value));
  const breaks = element.querySelectorAll("[data-break]");
  listenToBreaks(breaks, simulation);
  find(".robot-fault button").addEventListener("click", () => {
    simulation.repair();
    find(".robot-room").focus({ preventScroll: true });
  });
  const drive = (twist) => (simulation.twist = twist);
  const stop = () => simulation.link.command("E_STOP");
  listen(element, find(".robot-stick"), { drive, stop });
  find("[data-stop]").addEventListener("click", stop);
  find("[data-restart]").addEventListener("click", () => location.reload());
  focusOnLink(find(".robot-room"));
  const wait = matchMedia("(prefers-reduced-motion: reduce)").matches;
  if (wait) simulation.twist = { v_m_s: 0, w_rad_s: 0 };

  run(
    element,
    () => room.add(simulation.step()),
    (rate) => {
      room.draw(simulation);
      for (const chart of charts) chart.draw(simulation.history);
      showState(find, simulation, rate);
      showBreaks(breaks, simulation);
    },
  );
}

/** Let the keys drive at once after a link to the robot's heading. */
function focusOnLink(room) {
  const focus = () => location.hash === LINK && room.focus({ preventScroll: true });
  window.addEventListener("hashchange", focus);
  document.querySelector(`.hero a[href$="${LINK}"]`)?.addEventListener("click", () => setTimeout(focus));
  focus();
}

function chartsOf(find) {
  const speeds = (side) => [
    { colour: "setpoint", value: (each) => each[`${side}_setpoint`] / 1000, wide: true },
    { colour: side, value: (each) => each[`${side}_speed`] / 1000 },
  ];
  const pwm = ["left", "right"].map((side) => ({ colour: side, value: (each) => each[`${side}_pwm`] }));
  const [left, right] = [speeds("left"), speeds("right")];
  const scale = [...left, ...right];
  return [
    new Chart(find("[data-chart=left]"), { series: left, scale, least: 8 }),
    new Chart(find("[data-chart=right]"), { series: right, scale, least: 8 }),
    new Chart(find("[data-chart=pwm]"), { series: pwm, least: 255 }),
  ];
}

function showState(find, simulation, rate) {
  const { newest, pose, link } = simulation;
  if (!newest) return;
  find(".robot-stage").dataset.low = pose.y_m < SIZE_M[1] / 2;  // texts keep clear of the robot
  const text = (selector, content) => {
    const node = find(selector);
    if (node.textContent !== content) node.textContent = content;
  };
  text("[data-chip=state]", link.plugged ? STATES[newest.state] : "no link");
  find("[data-chip=state]").title = STATE_TITLES[newest.state] ?? "The motors are off";
  text("[data-chip=battery]", `${(newest.battery_mV / 1000).toFixed(1)} V`);
  text("[data-chip=rate]", `${rate.toFixed(1)} × real time`);
  const broken = newest.fault !== "NONE";
  find(".robot-fault").hidden = !broken;
  find("[data-chip=state]").dataset.fault = broken || !link.plugged;
  const remedy = !broken ? "" : newest.fault === "E_STOP" ? "Clear the fault" : "Repair and clear the fault";
  text("[data-hint]", hint(simulation, remedy));
  find("[data-how]").hidden = broken;
  if (!broken) return;
  text(".robot-fault b", faults[newest.fault].name);
  text(".robot-fault span", faults[newest.fault].hint);
  text(".robot-fault button", simulation.repaired ? "Clearing\u2026" : remedy);
  find(".robot-fault button").disabled = simulation.repaired;
}

start(document.getElementById("robot"));
