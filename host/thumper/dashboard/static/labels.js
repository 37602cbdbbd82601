// Labels of places, zones and objects, placed so that they overlap neither each other nor a marker.

import { colour } from "./colours.js";

const FONT = "600 12px Roboto, sans-serif";
const LINE_PX = 15;
const MARKER_PX = 9; // from its middle to its edge

// Shifts of the middle of a label's baseline from what it names, the best one first [pixels].
const AROUND_MARKER = (width) => {
  const beside = width / 2 + MARKER_PX + 4;
  return [[0, 22], [beside, 4], [-beside, 4], [0, -13], [0, 22 + LINE_PX], [0, -13 - LINE_PX], [beside, 4 + LINE_PX],
    [-beside, 4 + LINE_PX], [beside, 4 - LINE_PX], [-beside, 4 - LINE_PX]];
};
const AROUND_MIDDLE = () => [0, 1, -1, 2, -2, 3, -3].map((lines) => [0, lines * LINE_PX]);

const overlap = (a, b) => Math.max(0, Math.min(a[2], b[2]) - Math.max(a[0], b[0]))
  * Math.max(0, Math.min(a[3], b[3]) - Math.max(a[1], b[1]));

// Collects what is named on the map, then draws the names.
export class Labels {
  constructor() {
    this.labels = [];
    this.taken = []; // boxes: left, top, right, bottom [pixels]
  }

  // Name a marker, or an area by its middle.
  add(text, [px, py], isMarker = true) {
    if (!text) return;
    this.labels.push({ text, px, py, shifts: isMarker ? AROUND_MARKER : AROUND_MIDDLE });
    if (isMarker) this.taken.push([px - MARKER_PX, py - MARKER_PX, px + MARKER_PX, py + MARKER_PX]);
  }

  draw(context) {
    context.save();
    context.font = FONT;
    context.textAlign = "center";
    context.lineWidth = 3;
    context.strokeStyle = colour("map-free");
    context.fillStyle = colour("text");
    for (const { text, px, py, shifts } of this.labels) {
      const { width } = context.measureText(text);
      const boxes = shifts(width).map(([dx, dy]) => (
        [px + dx - width / 2, py + dy - 12, px + dx + width / 2, py + dy - 12 + LINE_PX]));
      const covered = boxes.map((box) => this.taken.reduce((sum, other) => sum + overlap(box, other), 0));
      const best = boxes[covered.indexOf(Math.min(...covered))];
      this.taken.push(best);
      const at = [(best[0] + best[2]) / 2, best[1] + 12];
      context.strokeText(text, ...at);
      context.fillText(text, ...at);
    }
    context.restore();
  }
}
