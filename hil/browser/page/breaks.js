// What the page's buttons break: whether it is broken now, how to break and repair it, and what to do to see it.

const UNPLUGGED_MS = 1000;  // the button names it

export const BREAKS = {
  cut: {
    isBroken: ({ robot }) => robot.encoders[0].cut,
    set: ({ robot }, broken) => robot.cutEncoder(0, broken),
    hint: "Left encoder wire cut: now drive.",
  },
  block: {
    isBroken: ({ robot }) => robot.drive.blocked[1],
    set: ({ robot }, broken) => (robot.drive.blocked[1] = broken),
    hint: "Right wheels blocked: now drive.",
  },
  unplug: {
    isBroken: ({ link }) => !link.plugged,
    set: (simulation, broken) => (broken ? simulation.unplug(UNPLUGGED_MS) : (simulation.link.plugged = true)),
  },
  drain: {
    isBroken: ({ robot }) => robot.drive.battery.charge < 0.02,
    set: ({ robot }, broken) => (robot.drive.battery.charge = broken ? 0.01 : robot.params.battery.state_of_charge),
  },
};

/** Let each button break its part, or repair it if it is broken. */
export function listenToBreaks(buttons, simulation) {
  for (const button of buttons) {
    const part = BREAKS[button.dataset.break];
    button.addEventListener("click", () => part.set(simulation, !part.isBroken(simulation)));
  }
}

/** Show on the buttons what is broken now. */
export function showBreaks(buttons, simulation) {
  for (const button of buttons) {
    const pressed = String(BREAKS[button.dataset.break].isBroken(simulation));
    if (button.ariaPressed !== pressed) button.ariaPressed = pressed;
  }
}
