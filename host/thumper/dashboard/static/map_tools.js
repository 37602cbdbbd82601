// What a pointer does on the map: look round, or give a goal, a pose estimate, waypoints or an obstacle.
// Goal and pose are set as in RViz: press where, drag which way, let go.

import { drawArrow, LAYERS } from "./map_layers.js";
import { send } from "./stream.js";

const TURN_PX = 12; // a shorter drag gives no heading
const TOOLS = {
  look: { icon: "pan_tool", title: "Look: drag moves, wheel or two fingers zoom", key: "v" },
  goal: { icon: "flag", title: "Goal: press where, drag which way", key: "g" },
  waypoints: { icon: "route", title: "Waypoints: click one after the other, then Drive", key: "w" },
  pose: { icon: "assistant_navigation", title: "Pose estimate: press where the robot is, drag its heading", key: "p" },
  obstacle: { icon: "add_box", title: "Obstacle: click to put a pillar into the simulated world", key: "o" },
};
const OBSTACLE_RADIUS_M = 0.15;

export class Tools {
  constructor(view, root) {
    this.view = view;
    this.tool = "look";
    this.waypoints = [];
    this.drag = null;
    this.pointers = new Map();
    this.buildBar(root);
    const canvas = view.canvas;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => this.cancel(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    document.addEventListener("keydown", (event) => this.key(event));
    document.addEventListener("click", (event) => { // a button elsewhere that chooses a tool
      const wanted = event.target.closest?.("[data-choose]")?.dataset.choose;
      if (wanted) this.choose(wanted);
    });
  }

  buildBar(root) {
    const bar = root.appendChild(document.createElement("div"));
    bar.className = "tp-toolbar";
    this.buttons = {};
    for (const [name, { icon, title, key }] of Object.entries(TOOLS)) {
      const button = this.button(bar, icon, `${title} (${key.toUpperCase()})`, () => this.choose(name));
      button.dataset.tool = name;
      this.buttons[name] = button;
    }
    bar.appendChild(document.createElement("hr"));
    this.button(bar, "fit_screen", "Show the whole map", () => {
      this.view.camera.touched = false;
      this.setFollow(false);
      this.view.fit();
    });
    this.followButton = this.button(bar, "gps_fixed", "Keep the robot in the middle", () => {
      this.setFollow(!this.view.follow);
    });
    const layersButton = this.button(bar, "layers", "Layers", () => { menu.hidden = !menu.hidden; });
    layersButton.dataset.tool = "layers";
    const menu = bar.appendChild(document.createElement("div"));
    menu.className = "tp-layers";
    menu.hidden = true;
    for (const [name, title] of LAYERS) {
      const label = menu.appendChild(document.createElement("label"));
      const box = label.appendChild(document.createElement("input"));
      box.type = "checkbox";
      box.checked = true;
      box.dataset.layer = name;
      box.addEventListener("change", () => this.view.change(() => { this.view.shown[name] = box.checked; }));
      label.append(title);
    }
    this.route = root.appendChild(document.createElement("div"));
    this.route.className = "tp-route";
    this.route.hidden = true;
    this.routeText = this.route.appendChild(document.createElement("span"));
    this.routeButton("Drive", "tp-go", () => this.driveWaypoints());
    this.routeButton("Undo", "", () => this.setWaypoints(this.waypoints.slice(0, -1)));
    this.routeButton("Clear", "", () => this.setWaypoints([]));
    this.choose("look");
  }

  button(bar, icon, title, action) {
    const button = bar.appendChild(document.createElement("button"));
    button.type = "button";
    button.title = title;
    button.setAttribute("aria-label", title);
    button.innerHTML = `<i class="material-icons">${icon}</i>`;
    button.addEventListener("click", action);
    return button;
  }

  routeButton(text, name, action) {
    const button = this.route.appendChild(document.createElement("button"));
    button.type = "button";
    button.textContent = text;
    button.className = name;
    button.addEventListener("click", action);
  }

  choose(name) {
    this.tool = name;
    for (const [key, button] of Object.entries(this.buttons)) button.classList.toggle("on", key === name);
    this.view.canvas.style.cursor = name === "look" ? "grab" : "crosshair";
    this.setWaypoints(name === "waypoints" ? this.waypoints : []);
  }

  setFollow(follow) {
    this.view.follow = follow;
    if (follow) this.view.camera.touched = true;
    this.followButton.classList.toggle("on", follow);
    this.view.dirty = true;
  }

  setWaypoints(waypoints) {
    this.waypoints = waypoints;
    this.route.hidden = this.tool !== "waypoints";
    const count = waypoints.length;
    this.routeText.textContent = count ? `${count} waypoint${count > 1 ? "s" : ""}` : "Click the places in turn";
    this.view.dirty = true;
  }

  driveWaypoints() {
    if (this.waypoints.length === 0) return;
    send({ kind: "waypoints", places: this.waypoints });
    this.choose("look");
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|TEXTAREA/.test(event.target.tagName)) return;
    const found = Object.entries(TOOLS).find(([, { key }]) => key === event.key.toLowerCase());
    if (found && !this.buttons[found[0]].hidden) this.choose(found[0]);
  }

  place(event) {
    const box = this.view.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  down(event) {
    this.view.canvas.setPointerCapture(event.pointerId);
    const [px, py] = this.place(event);
    this.pointers.set(event.pointerId, [px, py]);
    if (this.pointers.size === 1) this.drag = { px, py, qx: px, qy: py };
    else this.drag = null; // two fingers: zoom, whatever the tool
  }

  move(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const [px, py] = this.place(event);
    const [ox, oy] = this.pointers.get(event.pointerId);
    const looking = this.tool === "look" || event.buttons === 4 || event.buttons === 2;
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(ox - other[0], oy - other[1]);
      const now = Math.hypot(px - other[0], py - other[1]);
      if (before > 0) this.view.camera.zoom(now / before, (px + other[0]) / 2, (py + other[1]) / 2);
    } else if (this.drag) {
      if (looking) {
        this.view.camera.pan(px - ox, py - oy);
        this.setFollow(false);
      }
      this.drag.qx = px;
      this.drag.qy = py;
    }
    this.pointers.set(event.pointerId, [px, py]);
    this.view.dirty = true;
  }

  up(event) {
    const drag = this.drag;
    this.cancel(event);
    if (!drag || event.button !== 0) return;
    const [x, y] = this.view.camera.toMap(drag.px, drag.py);
    const yaw = this.heading(drag);
    if (this.tool === "goal") {
      send({ kind: "goal", x_m: x, y_m: y, yaw_rad: yaw });
      this.choose("look");
    } else if (this.tool === "pose") {
      send({ kind: "initial_pose", x_m: x, y_m: y, yaw_rad: yaw ?? this.view.pose?.[2] ?? 0 });
      this.choose("look");
    } else if (this.tool === "waypoints") {
      this.setWaypoints([...this.waypoints, [x, y]]);
    } else if (this.tool === "obstacle") {
      send({ kind: "obstacle", x_m: x, y_m: y, radius_m: OBSTACLE_RADIUS_M });
    }
  }

  cancel(event) {
    this.pointers.delete(event.pointerId);
    this.drag = null;
    this.view.dirty = true;
  }

  heading({ px, py, qx, qy }) {
    return Math.hypot(qx - px, qy - py) < TURN_PX ? null : Math.atan2(py - qy, qx - px);
  }

  wheel(event) {
    event.preventDefault();
    this.view.camera.zoom(Math.exp(-event.deltaY / 500), ...this.place(event));
    this.view.dirty = true;
  }

  draw(context, camera) {
    this.waypoints.forEach(([x, y], k) => drawArrow(context, camera, x, y, null, "goal", String(k + 1)));
    if (!this.drag || !["goal", "pose"].includes(this.tool)) return;
    const [x, y] = camera.toMap(this.drag.px, this.drag.py);
    drawArrow(context, camera, x, y, this.heading(this.drag), this.tool === "goal" ? "goal" : "estimate");
  }
}
