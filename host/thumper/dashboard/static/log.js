// The robot's event log, newest line first.

import { on } from "./stream.js";

const MAX_LINES = 100;
const MIN_UNIX_TIME_S = 1e8; // smaller stamps are seconds of a simulation, not a time of day

export function log(root) {
  on("events", (events) => {
    for (const { time_s, level, text } of events) {
      const line = document.createElement("div");
      line.className = `tp-logline ${level}`;
      const time = line.appendChild(document.createElement("time"));
      time.textContent = time_s > MIN_UNIX_TIME_S
        ? new Date(1000 * time_s).toLocaleTimeString("en-GB") : `${time_s.toFixed(1)} s`;
      line.appendChild(document.createElement("span")).textContent = text;
      root.prepend(line);
    }
    while (root.children.length > MAX_LINES) root.lastChild.remove();
  });
  on("snapshot", () => root.replaceChildren());
}
