// A simulated robot that starts again in another world. Until it is there, the banner says so instead of that the
// connection is lost. The page loads again meanwhile, with its server: the note outlives that.

const NOTE = "tp-restart";
const LONGEST_MS = 60000;
const RESTARTS = /^the robot starts again in the world (.+), with a new map$/;

export function noteRestart(eventText) {
  const world = RESTARTS.exec(eventText)?.[1];
  if (world) sessionStorage.setItem(NOTE, JSON.stringify({ world, since_ms: Date.now() }));
}

// Return the banner's text for a lost link; empty if the robot does not start again.
export function restartText() {
  const note = JSON.parse(sessionStorage.getItem(NOTE));
  if (!note || Date.now() - note.since_ms > LONGEST_MS) return "";
  sessionStorage.setItem(NOTE, JSON.stringify({ ...note, wasGone: true }));
  return `The robot restarts in the world ${note.world} …`;
}

// The robot sends data: if its restart has begun, it is over.
export function endRestart() {
  if (JSON.parse(sessionStorage.getItem(NOTE))?.wasGone) sessionStorage.removeItem(NOTE);
}
