// The map: a canvas with layers, and tools that turn a click or a drag into an order.

import { colour, onTheme } from "./colours.js";
import { Camera } from "./map_camera.js";
import * as layers from "./map_layers.js";
import { Tools } from "./map_tools.js";
import { on, state } from "./stream.js";

const TRAIL_STEP_M = 0.03;
const TRAIL_POINTS = 4000;

class MapView {
  constructor(root, options) {
    this.footprint = options.footprint;
    this.camera = new Camera();
    this.canvas = root.appendChild(document.createElement("canvas"));
    this.canvas.setAttribute("aria-label", "map");
    this.context = this.canvas.getContext("2d");
    this.data = { scan: [], plan: [], local_plan: [], particles: [], trail: [] };
    this.grids = {};
    this.raw = {};
    this.pose = null;
    this.scans = 0;
    this.follow = false;
    this.shown = Object.fromEntries(layers.LAYERS.map(([name]) => [name, true]));
    this.dirty = true;
    this.drawn = 0; // frames, for tests and benchmarks
    this.tools = new Tools(this, root);
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    onTheme(() => this.repaint());
    for (const name of ["scan", "plan", "local_plan", "particles"]) {
      on(name, (points) => this.change(() => { this.data[name] = points; }));
    }
    for (const name of ["map", "local_costmap"]) on(name, (grid) => this.setGrid(name, grid));
    on("pose", (pose) => this.change(() => this.setPose(pose)));
    on("status", ({ lidar_scans }) => this.change(() => {
      if (lidar_scans < this.scans) this.data.trail = []; // the robot was started anew, with another map
      this.scans = lidar_scans;
    }));
    on("fresh", () => this.change(() => { this.data.trail = []; }));
    this.resize();
    const frame = () => {
      if (this.dirty && this.canvas.isConnected) this.draw();
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  change(what) {
    what();
    this.dirty = true;
  }

  resize() {
    const box = this.canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    this.camera.width = box.width;
    this.camera.height = box.height;
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.camera.touched) this.fit();
    this.dirty = true;
  }

  setPose(pose) {
    this.pose = pose;
    const trail = this.data.trail;
    const far = trail.length === 0
      || Math.hypot(pose[0] - trail.at(-2), pose[1] - trail.at(-1)) > TRAIL_STEP_M;
    if (far) trail.push(pose[0], pose[1]);
    if (trail.length > 2 * TRAIL_POINTS) trail.splice(0, 2);
    if (this.follow) [this.camera.x, this.camera.y] = pose;
  }

  async setGrid(name, grid) {
    this.raw[name] = grid;
    const palette = name === "map" ? layers.mapPalette() : layers.costPalette();
    const painted = await layers.gridImage(grid, palette);
    if (this.raw[name] !== grid) return; // a newer one has overtaken it
    this.grids[name] = painted;
    if (name === "map" && !this.camera.touched) this.fit();
    this.dirty = true;
  }

  repaint() {
    for (const [name, grid] of Object.entries(this.raw)) this.setGrid(name, grid);
    this.dirty = true;
  }

  fit() {
    const { place, known } = this.grids.map ?? {};
    if (!place || known.left >= known.right) return;
    const [x, y] = place.origin;
    const size = place.resolution_m;
    this.camera.fit(x + known.left * size, y + known.low * size,
      x + known.right * size, y + known.high * size);
    this.dirty = true;
  }

  draw() {
    const { context, camera, data, shown } = this;
    this.dirty = false;
    context.fillStyle = colour("map-unknown");
    context.fillRect(0, 0, camera.width, camera.height);
    if (shown.map && this.grids.map) layers.drawGrid(context, camera, this.grids.map);
    if (shown.local_costmap && this.grids.local_costmap) {
      layers.drawGrid(context, camera, this.grids.local_costmap);
    }
    layers.drawRuler(context, camera);
    if (shown.trail) layers.drawLine(context, camera, data.trail, "trail", 2);
    if (shown.particles) layers.drawParticles(context, camera, data.particles);
    const status = state.values.status;
    if (status?.has_goal) { // without one, the newest plan is an old one
      if (shown.plan) layers.drawLine(context, camera, data.plan, "plan", 3);
      if (shown.local_plan) layers.drawLine(context, camera, data.local_plan, "local-plan", 3);
    }
    if (shown.footprint && this.pose) layers.drawRobot(context, camera, this.pose, this.footprint);
    if (shown.scan) layers.drawPoints(context, camera, data.scan, "scan", 3);
    if (status?.has_goal) {
      layers.drawArrow(context, camera, status.goal_x_m, status.goal_y_m,
        status.goal_yaw_rad ?? null, "goal"); // no heading asked for: none shown
    }
    this.tools.draw(context, camera);
    this.drawn += 1;
  }
}

export function map(root, options) {
  root.mapView = new MapView(root, options);
}
