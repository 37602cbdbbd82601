// The line under the flat: what happens now, if it is not seen, before the words on how to drive.
import { BREAKS } from "./breaks.js";

const SLIP_SHOWN_MS = 1000, UNPLUGGED_SHOWN_MS = 4000;
const touch = matchMedia("(hover: none)").matches;
const BACK_OFF = touch ? "Pull the stick back." : "Back off with S.";
const DRIVE_OFF = touch ? "Push the stick forward." : "Drive off with W.";

/** Return the line's first sentences; `remedy` is the text of the button that clears a fault, empty without one. */
export function hint(simulation, remedy) {
  const { twist, waits, ms, slipped_at_ms, slipped_backwards, unplugged_off_at_ms, link, newest, repaired } = simulation;
  if (remedy && repaired) return "Repaired. The board clears the fault once its readings are good.";
  if (remedy) return `The firmware stopped the motors. Press \u201c${remedy}\u201d, then drive on.`;
  if (!link.plugged && newest?.state === "CLOSED_LOOP") {
    return "Cable unplugged: without commands the firmware stops the motors after 0.3 s.";
  }
  if (ms - slipped_at_ms < SLIP_SHOWN_MS) {
    const escape = slipped_backwards ? DRIVE_OFF : BACK_OFF;
    return `Contact: the wheels slip, and their counts (dashed outline) run on. ${escape}`;
  }
  if (twist && twist.v_m_s === 0 && twist.w_rad_s === 0) {
    if (ms - unplugged_off_at_ms < UNPLUGGED_SHOWN_MS) return "Cable unplugged: the motors were off, so nothing stops.";
    for (const part of Object.values(BREAKS)) if (part.hint && part.isBroken(simulation)) return part.hint;
  }
  if (!link.plugged) return "Cable unplugged: no command reaches the board.";
  if (waits) return "Fault cleared: the robot arms when you drive.";
  return twist ? "You drive it now." : "It drives itself until you do.";
}
