// What the robot says: its newest events, newest on top.

import { on } from "./stream.js";

const KEPT = 100;

export function log(root) {
  on("events", (events) => {
    for (const { time_s, level, text } of events) {
      const line = document.createElement("div");
      line.className = `tp-logline ${level}`;
      const when = line.appendChild(document.createElement("time"));
      when.textContent = time_s > 1e8 ? new Date(1000 * time_s).toLocaleTimeString("en-GB") : `${time_s.toFixed(1)} s`;
      line.appendChild(document.createElement("span")).textContent = text;
      root.prepend(line);
    }
    while (root.children.length > KEPT) root.lastChild.remove();
  });
  on("whole", () => root.replaceChildren());
}
