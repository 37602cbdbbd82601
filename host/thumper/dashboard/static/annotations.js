// Zones, places and objects of the map: the tools that draw them, and how they look.

import { colour } from "./colours.js";
import { Labels } from "./labels.js";
import { drawArrow } from "./map_layers.js";
import { send, state } from "./stream.js";

const MIN_CORNERS = 3;
const rounded = (metres) => Math.round(1000 * metres) / 1000;

// Add or replace a zone or place; `points` are [x, y] [m], one of them for a place.
export function sendFeature(kind, name, points, properties = {}) {
  const corners = points.map(([x, y]) => [rounded(x), rounded(y)]);
  const geometry = kind === "place" ? { type: "Point", coordinates: corners[0] }
    : { type: "Polygon", coordinates: [[...corners, corners[0]]] };
  return send({ kind: "add_annotation", feature: { type: "Feature", properties: { ...properties, kind, name }, geometry } });
}

export const features = (values = state.values) => values.annotations?.features ?? [];

// The bar over the map in which a zone or place gets its name. `tools` are the map's tools.
export class AnnotationBar {
  constructor(root, tools) {
    this.tools = tools;
    this.points = [];
    this.heading = null;
    this.bar = root.appendChild(document.createElement("form"));
    this.bar.className = "tp-waypointbar tp-annotationbar";
    this.bar.hidden = true;
    this.bar.innerHTML = `
      <span></span>
      <select aria-label="kind of zone">
        <option value="keepout">Keep-out</option>
        <option value="slow:70">Slow, 70 %</option><option value="slow:50">Slow, 50 %</option>
        <option value="slow:30">Slow, 30 %</option>
      </select>
      <input type="text" maxlength="40" autocomplete="off" aria-label="name" placeholder="name">
      <button class="tp-go">Save</button><button type="button" data-undo>Undo</button>`;
    [this.text, this.kind, this.name, this.save] = this.bar.children;
    this.bar.addEventListener("submit", (event) => {
      event.preventDefault();
      this.submit();
    });
    this.bar.querySelector("[data-undo]").addEventListener("click", () => this.set(this.points.slice(0, -1)));
    this.kind.addEventListener("change", () => this.set(this.points));
    this.name.addEventListener("input", () => this.set(this.points));
  }

  get isZone() {
    return this.tools.tool === "zone";
  }

  // Show or hide the bar for the tool that is on.
  update() {
    this.bar.hidden = !["zone", "place"].includes(this.tools.tool);
    this.kind.hidden = !this.isZone;
    this.bar.querySelector("[data-undo]").hidden = !this.isZone;
    this.name.value = "";
    this.set([]);
  }

  // A click of the tool: one more corner, or where the place is.
  add(point, heading) {
    this.heading = heading;
    this.set(this.isZone ? [...this.points, point] : [point]);
    if (!this.isZone) this.name.focus();
  }

  set(points) {
    this.points = points;
    const missing = MIN_CORNERS - points.length;
    this.save.disabled = this.isZone ? missing > 0 : points.length === 0;
    this.text.textContent = !this.isZone ? "Click the place" : missing > 0 ? "Click the corners" : `${points.length} corners`;
    this.replaces = "";
    this.save.textContent = "Save";
    this.name.placeholder = this.isZone ? "name (optional)" : "name, such as kitchen";
    this.tools.view.redraw();
  }

  submit() {
    const name = this.name.value.trim();
    if (this.save.disabled) return;
    if (!this.isZone && !name) {
      this.name.focus();
      return;
    }
    if (name !== this.replaces && features().some(({ properties }) => properties.name === name)) {
      this.replaces = name; // the next press replaces it
      this.text.textContent = `${name} exists already. Replace it?`;
      this.save.textContent = "Replace";
      return;
    }
    const [kind, percent] = this.isZone ? this.kind.value.split(":") : ["place"];
    const properties = percent ? { speed_percent: Number(percent) } : {};
    if (kind === "place" && this.heading !== null) properties.yaw_rad = this.heading;
    if (!sendFeature(kind, name, this.points, properties)) return;
    this.tools.view.canvas.focus(); // the hidden field would take the next key
    this.tools.selectTool("pan");
  }

  draw(context, camera) {
    if (this.points.length === 0) return;
    if (this.isZone) drawZone(context, camera, this.points, this.kind.value.split(":")[0]);
    else drawArrow(context, camera, ...this.points[0], this.heading, "place");
    context.fillStyle = colour("place");
    for (const point of this.points) {
      context.beginPath();
      context.arc(...camera.toScreen(...point), 4, 0, 2 * Math.PI);
      context.fill();
    }
  }
}

function drawZone(context, camera, ring, kind) {
  context.save();
  context.beginPath();
  for (const point of ring) context.lineTo(...camera.toScreen(...point));
  context.closePath();
  context.fillStyle = context.strokeStyle = colour(kind);
  context.lineWidth = 2;
  context.globalAlpha = 0.22;
  context.fill();
  context.globalAlpha = 1;
  if (kind === "slow") context.setLineDash([6, 4]); // a difference that needs no colours
  context.stroke();
  context.restore();
}

export function drawAnnotations(context, camera) {
  const labels = new Labels();
  for (const { properties, geometry } of features(state.shown)) {
    const { kind, name, speed_percent, yaw_rad } = properties;
    if (geometry.type === "Point") { // a place or a tag
      drawArrow(context, camera, ...geometry.coordinates, yaw_rad ?? null, "place");
      labels.add(name, camera.toScreen(...geometry.coordinates));
    } else {
      const [ring] = geometry.coordinates;
      drawZone(context, camera, ring, kind);
      const middle = [0, 1].map((axis) => ring.reduce((sum, point) => sum + point[axis], 0) / ring.length);
      labels.add(speed_percent ? `${name} ${speed_percent} %` : name, camera.toScreen(...middle), false);
    }
  }
  for (const [label, x, y] of state.shown.objects ?? []) { // seen by a detector
    drawArrow(context, camera, x, y, null, "slow");
    labels.add(label, camera.toScreen(x, y));
  }
  labels.draw(context);
}
