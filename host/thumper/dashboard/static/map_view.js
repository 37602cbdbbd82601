// The map widget: a canvas with layers, and tools that turn a click or a drag into a command.

import { colour, isDark, onThemeChange } from "./colours.js";
import { drawAnnotations } from "./annotations.js";
import { Camera } from "./map_camera.js";
import * as layers from "./map_layers.js";
import { MapTools } from "./map_tools.js";
import { on, state } from "./stream.js";
import { laneLength } from "./tune.js";

const TRAIL_STEP_M = 0.03;
const JUMP_M = 0.5; // between two poses: the estimate has jumped, the robot has not driven there
const LOST_OPACITY = 0.35; // of a robot whose pose is lost
const MAX_TRAIL_POINTS = 4000;

class MapView {
  constructor(root, options) {
    this.footprint = options.footprint;
    this.camera = new Camera();
    this.canvas = root.appendChild(document.createElement("canvas"));
    this.canvas.setAttribute("aria-label", "map");
    this.context = this.canvas.getContext("2d");
    this.data = { scan: [], plan: [], local_plan: [], particles: [], trail: [], gps: [] };
    this.gpsStd_m = 0;
    this.grids = {}; // as drawn
    this.receivedGrids = {};
    this.pose = null;
    this.scanCount = 0;
    this.follow = false;
    this.visible = Object.fromEntries(layers.LAYERS.map(([name]) => [name, true]));
    this.frame = null; // the animation frame that will draw
    this.tools = new MapTools(this, root);
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    onThemeChange(() => this.recolour());
    for (const name of ["scan", "plan", "local_plan", "particles"]) {
      on(name, (points) => this.update(() => { this.data[name] = points; }));
    }
    for (const name of ["map", "local_costmap"]) on(name, (grid) => this.setGrid(name, grid));
    on("pose", (pose) => this.update(() => this.setPose(pose)));
    on("status", ({ lidar_scans }) => this.update(() => {
      if (lidar_scans < this.scanCount) this.clearTracks(); // the count fell: the robot restarted with a new map
      this.scanCount = lidar_scans;
    }));
    on("annotations", () => this.update(() => {}));
    on("objects", () => this.update(() => {}));
    on("gps_odom", (at) => this.update(() => this.addGps(at)));
    on("trail", (points) => this.update(() => { this.data.trail = [...points]; }));
    on("playback", (name) => this.update(() => this.clear(name)));
    on("packet", () => { // a scan of a robot that is gone is not its surroundings now
      const isLost = document.body.dataset.link === "lost";
      if (isLost !== this.isLost) this.redraw();
      this.isLost = isLost;
    });
    on("opened", () => this.update(() => this.clearTracks()));
    this.resize();
  }

  update(change) {
    change();
    this.redraw();
  }

  // Draw at the next animation frame. Without a change there is none: each costs a laptop without a GPU some milliseconds.
  redraw() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      if (this.canvas.isConnected) this.draw();
    });
  }

  resize() {
    const box = this.canvas.getBoundingClientRect();
    const ratio = window.devicePixelRatio || 1;
    this.camera.width = box.width;
    this.camera.height = box.height;
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (!this.camera.userControlled) this.fit();
    this.redraw();
  }

  // Take the newest pose; extend the trail and, if `follow` is on, centre the view.
  setPose(pose) {
    this.pose = pose;
    const trail = this.data.trail;
    const hasMoved = !state.shown.status?.pose_lost && (trail.length === 0
      || Math.hypot(pose[0] - trail.at(-2), pose[1] - trail.at(-1)) > TRAIL_STEP_M);
    if (hasMoved) trail.push(pose[0], pose[1]);
    if (trail.length > 2 * MAX_TRAIL_POINTS) trail.splice(0, 2);
    if (this.follow) [this.camera.x, this.camera.y] = pose;
  }

  clearTracks() {
    this.data.trail = [];
    this.data.gps = [];
  }

  // Take a position by GPS in the map: x, y and its standard deviation [m].
  addGps([x, y, std_m]) {
    this.data.gps.push(x, y);
    if (this.data.gps.length > 2 * MAX_TRAIL_POINTS) this.data.gps.splice(0, 2);
    this.gpsStd_m = std_m;
  }

  // Before a playback, after a jump in it and after its end: forget all; keep the robot's trail for the end.
  clear(recording) {
    this.live ??= { trail: this.data.trail, gps: this.data.gps };
    const tracks = recording ? { trail: [], gps: [] } : this.live;
    this.data = { scan: [], plan: [], local_plan: [], particles: [], ...tracks };
    if (!recording) this.live = null;
    this.grids = {};
    this.receivedGrids = {};
    this.pose = null;
    this.scanCount = 0;
    this.tools.cancel();
  }

  async setGrid(name, grid) {
    this.receivedGrids[name] = grid;
    await grid.drawn;
    if (this.receivedGrids[name] !== grid) return; // another grid arrived meanwhile
    this.grids[name] = grid;
    if (name === "map" && !this.camera.userControlled) this.fit();
    this.redraw();
  }

  // Colour the grids again after a change of theme.
  recolour() {
    for (const [name, grid] of Object.entries(this.receivedGrids)) {
      grid.recolour();
      this.setGrid(name, grid);
    }
    this.redraw();
  }

  // Show all known cells of the map.
  fit() {
    const { info, bounds } = this.grids.map ?? {};
    if (!info || bounds.left >= bounds.right) return;
    const [x, y] = info.origin;
    const cell = info.resolution_m;
    this.camera.fit(x + bounds.left * cell, y + bounds.bottom * cell,
      x + bounds.right * cell, y + bounds.top * cell);
    this.redraw();
  }

  draw() {
    const { context, camera, data, visible } = this;
    context.fillStyle = colour("map-unknown");
    context.fillRect(0, 0, camera.width, camera.height);
    if (visible.map && this.grids.map) layers.drawGrid(context, camera, this.grids.map);
    if (visible.local_costmap && this.grids.local_costmap) {
      context.globalCompositeOperation = isDark() ? "lighten" : "darken"; // walls stay as dark, or as light
      layers.drawGrid(context, camera, this.grids.local_costmap);
      context.globalCompositeOperation = "source-over";
    }
    if (visible.annotations) drawAnnotations(context, camera);
    layers.drawRuler(context, camera);
    if (visible.trail) layers.drawLine(context, camera, data.trail, "trail", 2, JUMP_M);
    if (visible.gps) layers.drawGps(context, camera, data.gps, this.gpsStd_m);
    if (visible.particles) layers.drawParticles(context, camera, data.particles);
    const status = state.shown.status;
    if (status?.has_goal) { // without a goal, the last plan is outdated
      if (visible.plan) layers.drawLine(context, camera, data.plan, "plan", 3);
      if (visible.local_plan) layers.drawLine(context, camera, data.local_plan, "local-plan", 3);
    }
    const lane_m = laneLength();
    if (!state.values.experiment?.running) this.laneStart = this.pose; // it stays there while the robot drives in it
    if (lane_m && this.laneStart && !state.playback) layers.drawLane(context, camera, this.laneStart, lane_m);
    if (visible.footprint && this.pose) {
      context.globalAlpha = status?.pose_lost ? LOST_OPACITY : 1;
      layers.drawRobot(context, camera, this.pose, this.footprint);
      context.globalAlpha = 1;
    }
    if (visible.scan && !this.isLost) layers.drawPoints(context, camera, data.scan, "scan", 3);
    if (status?.has_goal) {
      layers.drawArrow(context, camera, status.goal_x_m, status.goal_y_m,
        status.goal_yaw_rad ?? null, "goal"); // a goal without a heading has no arrow
    }
    this.tools.draw(context, camera);
  }
}

export function map(root, options) {
  root.mapView = new MapView(root, options);
}
