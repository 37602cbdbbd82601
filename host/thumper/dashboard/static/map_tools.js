// Tools of the map, for pointer and keyboard: pan, goal, route, pose, zone, place, pillar.
// Goal and pose work as in RViz: press at the position, drag to set the heading, release.

import { AnnotationBar } from "./annotations.js";
import { colour } from "./colours.js";
import { isTyping, onCancel } from "./commands.js";
import { drawArrow, drawCrosshair, LAYERS } from "./map_layers.js";
import { fixed } from "./numbers.js";
import { on, send, state } from "./stream.js";

const MIN_HEADING_DRAG_PX = 12; // a shorter drag sets no heading
export const TOOLS = {
  pan: { icon: "pan_tool", label: "Pan", title: "Pan: drag to move the map, scroll or pinch to zoom", key: "v" },
  goal: { icon: "flag", label: "Goal", title: "Goal: press at the position, drag to set the heading", key: "g" },
  waypoints: { icon: "route", label: "Route", title: "Route: click the waypoints in order, drag for a heading, then press Drive", key: "r" },
  pose: {
    icon: "assistant_navigation",
    label: "Pose",
    title: "Pose: press at the robot's position, drag to set its heading",
    key: "p",
  },
  zone: {
    icon: "block",
    label: "Zone",
    title: "Zone: click the corners of a keep-out or slow zone, then press Save",
    key: "z",
  },
  place: {
    icon: "place",
    label: "Place",
    title: "Place: click to save a place by name, drag to set its heading",
    key: "l",
  },
  obstacle: {
    icon: "add_box",
    label: "Pillar",
    title: "Pillar: click to add one to the simulated world",
    key: "o",
  },
};
const OBSTACLE_RADIUS_M = 0.15;
const ARMING = ["goal", "waypoints"];
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class MapTools {
  constructor(view, root) {
    this.view = view;
    this.tool = "pan";
    this.waypoints = [];
    this.crosshair = null;
    this.drag = null;
    this.pointers = new Map();
    this.addToolbar(root);
    onCancel(() => this.cancel());
    on("packet", () => this.nameTools());
    const canvas = view.canvas;
    canvas.addEventListener("pointerdown", (event) => this.onPointerDown(event));
    canvas.addEventListener("pointermove", (event) => this.onPointerMove(event));
    canvas.addEventListener("pointerup", (event) => this.onPointerUp(event));
    canvas.addEventListener("pointercancel", (event) => this.endDrag(event));
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointermove", (event) => this.showCursor(this.position(event)));
    canvas.addEventListener("pointerleave", () => { this.cursor.textContent = ""; });
    document.addEventListener("keydown", (event) => this.onKey(event));
    canvas.tabIndex = 0; // arrow keys move a cross-hair, Enter uses the tool there
    canvas.addEventListener("keydown", (event) => this.onCanvasKey(event));
    canvas.addEventListener("blur", () => this.setCrosshair(null));
    document.addEventListener("click", (event) => { // buttons outside the map can select a tool, too
      const name = event.target.closest?.("[data-select-tool]")?.dataset.selectTool;
      if (name) this.selectTool(name);
    });
  }

  addToolbar(root) {
    const bar = root.appendChild(document.createElement("div"));
    bar.className = "tp-toolbar";
    this.buttons = {};
    for (const [name, { icon, label, title, key }] of Object.entries(TOOLS)) {
      const button = this.addButton(bar, icon, label, `${title} (${key.toUpperCase()})`, () => this.selectTool(name));
      button.dataset.tool = name;
      this.buttons[name] = button;
    }
    bar.appendChild(document.createElement("hr"));
    this.addButton(bar, "fit_screen", "Fit", "Fit the map to the view", () => {
      this.view.camera.userControlled = false;
      this.setFollow(false);
      this.view.fit();
    });
    this.followButton = this.addButton(bar, "gps_fixed", "Follow", "Follow the robot", () => {
      this.setFollow(!this.view.follow);
    });
    const layersButton = this.addButton(bar, "layers", "Layers", "Layers", () => { menu.hidden = !menu.hidden; });
    layersButton.dataset.tool = "layers";
    const menu = bar.appendChild(document.createElement("div"));
    this.menu = menu;
    menu.className = "tp-layers";
    menu.hidden = true;
    for (const [name, text, colourName] of LAYERS) {
      const label = menu.appendChild(document.createElement("label"));
      if (name === "gps") label.className = "tp-of-gps";
      const checkbox = label.appendChild(document.createElement("input"));
      checkbox.type = "checkbox";
      checkbox.checked = true;
      checkbox.dataset.layer = name;
      checkbox.addEventListener("change", () => this.view.update(() => {
        this.view.visible[name] = checkbox.checked;
      }));
      label.appendChild(document.createElement("i")).style.background = `var(--tp-${colourName})`;
      label.append(text);
    }
    this.cursor = root.appendChild(document.createElement("div"));
    this.cursor.className = "tp-cursor";
    this.toolName = root.appendChild(document.createElement("div"));
    this.toolName.className = "tp-toolname";
    this.waypointBar = root.appendChild(document.createElement("div"));
    this.waypointBar.className = "tp-waypointbar";
    this.waypointBar.hidden = true;
    this.waypointText = this.waypointBar.appendChild(document.createElement("span"));
    const wait = this.waypointBar.appendChild(document.createElement("label"));
    wait.textContent = "wait [s]";
    this.waitInput = wait.appendChild(document.createElement("input"));
    Object.assign(this.waitInput, { type: "number", min: 0, max: 3600, value: 0 });
    this.recordInput = this.addWaypointCheckbox("record");
    this.recordInput.addEventListener("change", () => {
      if (this.recordInput.checked && !(this.waitInput.value > 0)) this.waitInput.value = 5; // it records meanwhile
    });
    this.beepInput = this.addWaypointCheckbox("beep");
    this.addWaypointButton("Drive", "tp-go", () => this.driveWaypoints());
    this.addWaypointButton("Undo", "", () => this.setWaypoints(this.waypoints.slice(0, -1)));
    this.addWaypointButton("Clear", "", () => this.setWaypoints([]));
    this.annotationBar = new AnnotationBar(root, this);
    this.selectTool("pan");
  }

  addButton(bar, icon, label, title, action) {
    const button = bar.appendChild(document.createElement("button"));
    button.type = "button";
    button.title = title;
    button.setAttribute("aria-label", title);
    button.innerHTML = `<i class="material-icons">${icon}</i><small>${label}</small>`;
    button.addEventListener("click", action);
    return button;
  }

  addWaypointCheckbox(text) {
    const label = this.waypointBar.appendChild(document.createElement("label"));
    const input = label.appendChild(document.createElement("input"));
    input.type = "checkbox";
    label.append(text);
    return input;
  }

  addWaypointButton(text, className, action) {
    const button = this.waypointBar.appendChild(document.createElement("button"));
    button.type = "button";
    button.textContent = text;
    button.className = className;
    button.addEventListener("click", action);
  }

  selectTool(wanted) {
    const name = state.playback ? "pan" : wanted; // no goal on the map of a recording
    this.tool = name;
    for (const [key, button] of Object.entries(this.buttons)) button.classList.toggle("on", key === name);
    this.nameTools();
    this.view.canvas.style.cursor = name === "pan" ? "grab" : "crosshair";
    this.setWaypoints(name === "waypoints" ? this.waypoints : []);
    this.annotationBar.update();
  }

  // Name the tool in use, and say of those that arm the motors that they do.
  nameTools() {
    const isDisarmed = document.body.dataset.board === "disarmed";
    for (const name of ARMING) {
      const { title, key } = TOOLS[name];
      const hint = `${title}${isDisarmed ? "; this arms the motors" : ""} (${key.toUpperCase()})`;
      if (this.buttons[name].title !== hint) this.buttons[name].title = this.buttons[name].ariaLabel = hint;
    }
    const isArming = isDisarmed && this.tool === "goal";
    const { label = "" } = this.tool === "pan" ? {} : TOOLS[this.tool] ?? {}; // not of a box on a saved map
    const text = isArming ? "Goal: this arms the motors" : label;
    if (this.toolName.textContent !== text) this.toolName.textContent = text;
    this.toolName.classList.toggle("tp-arming", isArming);
  }

  // Choose boxes on a saved map: `onBox` gets their corners, x, y, x, y [m].
  startBox(onBox) {
    this.onBox = onBox;
    this.corner = null;
    this.tool = "box";
    this.buttons.pan.classList.remove("on");
    this.nameTools();
    this.view.canvas.style.cursor = "crosshair";
  }

  // Leave the tool without an effect and close the menu; return whether there was anything to leave.
  cancel() {
    const isActive = this.tool !== "pan" || !this.menu.hidden;
    this.drag = null; // a release of the mouse then sends nothing
    this.menu.hidden = true;
    this.selectTool("pan");
    return isActive;
  }

  setFollow(follow) {
    this.view.follow = follow;
    if (follow) this.view.camera.userControlled = true;
    this.followButton.classList.toggle("on", follow);
    this.view.redraw();
  }

  setWaypoints(waypoints) {
    this.waypoints = waypoints;
    this.waypointBar.hidden = this.tool !== "waypoints";
    const count = waypoints.length;
    this.waypointText.textContent = count ? `${count} waypoint${count > 1 ? "s" : ""}`
      : "Click waypoints in order";
    this.view.redraw();
  }

  driveWaypoints() {
    if (this.waypoints.length === 0) return;
    send({ kind: "waypoints", goals: this.waypoints });
    this.selectTool("pan");
  }

  onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
    const match = Object.entries(TOOLS).find(([, { key }]) => key === event.key.toLowerCase());
    const button = match && this.buttons[match[0]];
    if (button && !button.hidden && !button.disabled) this.selectTool(match[0]);
  }

  onCanvasKey(event) {
    if (event.key === "Enter" && this.crosshair && this.tool !== "pan") {
      event.preventDefault();
      this.use(...this.crosshair, null);
    }
    const [dx, dy] = ARROWS[event.key] ?? [0, 0];
    if (!dx && !dy) return;
    event.preventDefault();
    const { camera } = this.view;
    const step = (event.shiftKey ? 50 : 10) / camera.scale;
    if (this.tool === "pan") camera.pan(-10 * dx, 10 * dy);
    else this.setCrosshair((this.crosshair ?? [camera.x, camera.y]).map((metres, k) => metres + step * [dx, dy][k]));
    this.view.redraw();
  }

  // Show the cross-hair of the keyboard at a place [m]; null hides it.
  setCrosshair(place) {
    this.crosshair = place;
    if (place) this.showCursor(this.view.camera.toScreen(...place));
    this.view.redraw();
  }

  // Position of the pointer on the canvas [pixels].
  position(event) {
    const box = this.view.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  showCursor(position) {
    const [x, y] = this.view.camera.toMap(...position);
    this.cursor.textContent = `x ${fixed(x, 2)}, y ${fixed(y, 2)} m`;
  }

  onPointerDown(event) {
    this.view.canvas.setPointerCapture(event.pointerId);
    const [px, py] = this.position(event);
    this.pointers.set(event.pointerId, [px, py]);
    if (this.pointers.size === 1) this.drag = { startX: px, startY: py, endX: px, endY: py };
    else this.drag = null; // two fingers zoom with every tool
  }

  onPointerMove(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const [px, py] = this.position(event);
    const [lastX, lastY] = this.pointers.get(event.pointerId);
    const panning = this.tool === "pan" || event.buttons === 4 || event.buttons === 2;
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(lastX - other[0], lastY - other[1]);
      const now = Math.hypot(px - other[0], py - other[1]);
      if (before > 0) this.view.camera.zoom(now / before, (px + other[0]) / 2, (py + other[1]) / 2);
    } else if (this.drag) {
      if (panning) {
        this.view.camera.pan(px - lastX, py - lastY);
        this.setFollow(false);
      }
      this.drag.endX = px;
      this.drag.endY = py;
    }
    this.pointers.set(event.pointerId, [px, py]);
    this.view.redraw();
  }

  onPointerUp(event) {
    const drag = this.drag;
    this.endDrag(event);
    if (!drag || event.button !== 0) return;
    const { camera } = this.view;
    if (this.tool === "box") {
      this.onBox([...camera.toMap(drag.startX, drag.startY), ...camera.toMap(drag.endX, drag.endY)]);
      return;
    }
    this.use(...this.view.camera.toMap(drag.startX, drag.startY), this.heading(drag));
  }

  // Use the tool at a place; `yaw_rad` is null if no heading was set.
  use(x, y, yaw_rad) {
    if (this.tool === "box") { // by keyboard: Enter at two opposite corners
      if (this.corner) this.onBox([...this.corner, x, y]);
      this.corner = this.corner ? null : [x, y];
    } else if (this.tool === "goal") {
      send({ kind: "goal", x_m: x, y_m: y, yaw_rad });
      this.selectTool("pan");
    } else if (this.tool === "pose") {
      send({ kind: "initial_pose", x_m: x, y_m: y, yaw_rad: yaw_rad ?? this.view.pose?.[2] ?? 0 });
      this.selectTool("pan");
    } else if (this.tool === "waypoints") {
      const wait_s = Math.min(Math.max(Number(this.waitInput.value), 0), 3600);
      const record = this.recordInput.checked && wait_s > 0;
      const beep = this.beepInput.checked;
      this.setWaypoints([...this.waypoints, { x_m: x, y_m: y, yaw_rad, wait_s, record, beep }]);
    } else if (["zone", "place"].includes(this.tool)) {
      this.annotationBar.add([x, y], yaw_rad);
    } else if (this.tool === "obstacle") {
      send({ kind: "obstacle", x_m: x, y_m: y, radius_m: OBSTACLE_RADIUS_M });
    }
  }

  endDrag(event) {
    this.pointers.delete(event.pointerId);
    this.drag = null;
    this.view.redraw();
  }

  // Heading of a drag [rad]; null if it is too short to set one.
  heading({ startX, startY, endX, endY }) {
    const [dx, dy] = [endX - startX, startY - endY]; // dy is up
    return Math.hypot(dx, dy) < MIN_HEADING_DRAG_PX ? null : Math.atan2(dy, dx);
  }

  onWheel(event) {
    event.preventDefault();
    this.view.camera.zoom(Math.exp(-event.deltaY / 500), ...this.position(event));
    this.view.redraw();
  }

  draw(context, camera) {
    this.waypoints.forEach(({ x_m, y_m, yaw_rad, wait_s, record, beep }, k) => {
      const tasks = [beep ? "beep" : "", wait_s ? `${record ? "record" : "wait"} ${wait_s} s` : ""].filter(Boolean);
      const text = [k + 1, tasks.join(", ")].filter(Boolean).join(": ");
      drawArrow(context, camera, x_m, y_m, yaw_rad, "goal", text);
    });
    this.annotationBar.draw(context, camera);
    if (this.crosshair) drawCrosshair(context, ...camera.toScreen(...this.crosshair));
    if (this.tool === "box") this.drawBox(context, camera);
    if (!this.drag || !["goal", "pose", "place", "waypoints"].includes(this.tool)) return;
    const [x, y] = camera.toMap(this.drag.startX, this.drag.startY);
    drawArrow(context, camera, x, y, this.heading(this.drag),
      { pose: "estimate", waypoints: "goal" }[this.tool] ?? this.tool);
  }

  drawBox(context, camera) {
    const drag = this.drag && [this.drag.startX, this.drag.startY, this.drag.endX, this.drag.endY];
    const keys = this.corner && this.crosshair && [...camera.toScreen(...this.corner), ...camera.toScreen(...this.crosshair)];
    const [x0, y0, x1, y1] = drag ?? keys ?? [];
    if (x0 === undefined) return;
    context.strokeStyle = colour("estimate");
    context.lineWidth = 2;
    context.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }
}
