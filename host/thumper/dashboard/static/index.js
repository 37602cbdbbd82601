// Entry point: the page's own widgets by name. `widget.js` mounts each of them.

import { camera } from "./camera.js";
import { charts } from "./charts.js";
import { startCommands } from "./commands.js";
import { drive } from "./drive.js";
import { library } from "./library.js";
import { log } from "./log.js";
import { addMapEditor } from "./map_editor.js";
import { map } from "./map_view.js";
import { addPlayback } from "./playback.js";
import { places } from "./places.js";
import { startReadouts } from "./readouts.js";
import { startShortcuts } from "./shortcuts.js";
import { startSliders } from "./sliders.js";
import { startStream, state } from "./stream.js";
import { tune } from "./tune.js";

export const widgets = { camera, charts, drive, library, log, map, places, tune };

let started = false;

export function startPage() {
  if (started) return;
  started = true;
  startCommands();
  startReadouts();
  startShortcuts();
  startSliders();
  startStream(); // first: the emergency stop needs it, and nothing below
  document.getElementById("tp-loading")?.remove(); // it covers the button of the emergency stop
  addPlayback();
  addMapEditor();
  window.thumper = { state }; // for the browser console and for tests
}
