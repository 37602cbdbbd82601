// What a latched fault of the board means for the rest of the page. The red box explains the fault itself.

const LINK_LOST = 1; // arming clears it

// Why the robot cannot move, and what to do first; empty if it can.
export function faultBlock(status) {
  if (!status?.fault || status.fault === LINK_LOST) return "";
  const name = status.fault_words;
  return `${name.charAt(0).toUpperCase()}${name.slice(1)}: clear the fault first`;
}

// Where a text that ends with the fault names it; -1 if it does not.
export function faultStart(text, status) {
  if (!status?.fault) return -1;
  return Math.max(...[status.fault_words, status.fault_cure].map((fault) => text.indexOf(`: ${fault}`)));
}
