// Draws the flat: what the lidar has seen so far, its last turn, the robot, and where its wheel counts put it.
import { OBSTACLES, OUTLINE, SIZE_M, footprint } from "../room.js";
import { fit } from "./canvas.js";
import { colours } from "./colours.js";

const MARGIN_M = 0.1;
const CELL_M = 0.04, DRAWN_M = 0.042;  // no seams between cells
const TRAIL_POINTS = 400, TRAIL_STEP_M = 0.04;

export class RoomView {
  constructor(canvas, outline) {
    this.canvas = canvas;
    this.outline = outline;
    this.seen = new Map();  // cells that a beam has hit, by their name
    this.trail = [];
  }

  /** Remember what the lidar's new points hit. */
  add(points) {
    for (const { x_m, y_m } of points) {
      const cell = [Math.round(x_m / CELL_M), Math.round(y_m / CELL_M)];
      this.seen.set(cell.join(), cell);
    }
  }

  draw({ pose, odometry, lidar, newest }) {
    const { context, width, height } = fit(this.canvas);
    const paint = colours(this.canvas);
    const scale = Math.min(width / (SIZE_M[0] + 2 * MARGIN_M), height / (SIZE_M[1] + 2 * MARGIN_M));
    context.clearRect(0, 0, width, height);
    context.save();
    context.translate((width - scale * SIZE_M[0]) / 2, (height + scale * SIZE_M[1]) / 2);
    context.scale(scale, -scale);  // metres, y up
    fill(context, OUTLINE, paint.floor);
    for (const corners of OBSTACLES) fill(context, corners, paint.wall);
    this.drawSeen(context, paint);
    this.drawTrail(context, paint, pose);
    dots(context, lidar.turn, 0.018, paint.scan);
    this.drawGhost(context, paint, odometry.pose);
    this.drawRobot(context, pose, newest?.fault === "NONE" ? paint.robot : paint.fault, paint.panel);
    context.restore();
  }

  drawSeen(context, paint) {
    context.fillStyle = paint.seen;
    for (const [x, y] of this.seen.values())
      context.fillRect((x - 0.5) * CELL_M, (y - 0.5) * CELL_M, DRAWN_M, DRAWN_M);
  }

  drawTrail(context, paint, { x_m, y_m }) {
    const [last_x, last_y] = this.trail.at(-1) ?? [Infinity, Infinity];
    if (Math.hypot(x_m - last_x, y_m - last_y) > TRAIL_STEP_M) this.trail.push([x_m, y_m]);
    this.trail.splice(0, this.trail.length - TRAIL_POINTS);
    context.beginPath();
    for (const point of this.trail) context.lineTo(...point);
    context.strokeStyle = paint.trail;
    context.lineWidth = 0.02;
    context.stroke();
  }

  drawGhost(context, paint, pose) {
    path(context, footprint(pose, this.outline));
    context.setLineDash([0.05, 0.04]);
    context.strokeStyle = paint.ghost;
    context.lineWidth = 0.018;
    context.stroke();
    context.setLineDash([]);
  }

  drawRobot(context, { x_m, y_m, yaw_rad }, colour, light) {
    const { length_m, width_m } = this.outline;
    context.save();
    context.translate(x_m, y_m);
    context.rotate(yaw_rad);
    context.fillStyle = colour;
    for (const side of [-1, 1])
      for (const axle_m of [-0.14, 0, 0.14])
        context.fillRect(axle_m - 0.055, side * (width_m / 2 - 0.035) - 0.035, 0.11, 0.07);
    context.beginPath();
    context.roundRect(-length_m / 2 + 0.02, -width_m / 2 + 0.06, length_m - 0.04, width_m - 0.12, 0.04);
    context.fill();
    context.fillStyle = light;
    context.beginPath();
    context.arc(0, 0, 0.05, 0, 2 * Math.PI);
    context.fill();
    path(context, [[0.17, 0], [0.1, 0.04], [0.1, -0.04]]);
    context.fill();
    context.restore();
  }
}

function path(context, corners) {
  context.beginPath();
  for (const corner of corners) context.lineTo(...corner);
  context.closePath();
}

function fill(context, corners, colour) {
  path(context, corners);
  context.fillStyle = colour;
  context.fill();
}

function dots(context, points, radius_m, colour) {
  context.fillStyle = colour;
  context.beginPath();
  for (const { x_m, y_m } of points) {
    context.moveTo(x_m + radius_m, y_m);
    context.arc(x_m, y_m, radius_m, 0, 2 * Math.PI);
  }
  context.fill();
}
