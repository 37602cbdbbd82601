// The page's own parts, by name; `part.js` puts each into its place.

import { charts } from "./charts.js";
import { drive } from "./drive.js";
import { log } from "./log.js";
import { map } from "./map_view.js";
import { startOrders } from "./orders.js";
import { startReadouts } from "./readouts.js";
import { start, state } from "./stream.js";
import { tune } from "./tune.js";

export const parts = { charts, drive, log, map, tune };

let started = false;

export function begin() {
  if (started) return;
  started = true;
  startOrders();
  startReadouts();
  start();
  window.thumper = { state }; // for the curious, and for tests
}
