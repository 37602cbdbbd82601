// Draws the map's layers. The canvas context works in pixels; `camera` converts metres to pixels.

import { colour } from "./colours.js";

// Name of the layer, label in the menu, colour of its swatch there.
export const LAYERS = [
  ["map", "Map", "map-wall"],
  ["local_costmap", "Local costmap", "cost-high"],
  ["particles", "Particles", "particles"],
  ["plan", "Plan", "plan"],
  ["local_plan", "Local plan", "local-plan"],
  ["trail", "Trail", "trail"],
  ["annotations", "Zones, places, objects", "keepout"],
  ["gps", "GPS", "gps"],
  ["scan", "Scan", "scan"],
  ["footprint", "Robot", "robot-edge"],
];

const LANE_WIDTH_M = 0.8;

export function drawGrid(context, camera, { canvas, info }) {
  const [x, y] = info.origin;
  const [px, py] = camera.toScreen(x, y);
  const cell = info.resolution_m * camera.scale;
  context.save();
  context.imageSmoothingEnabled = false;
  context.translate(px, py);
  context.drawImage(canvas, 0, -info.rows * cell, info.columns * cell, info.rows * cell);
  context.restore();
}

// Grid lines over the whole view, and a scale bar.
export function drawRuler(context, camera) {
  const step = [0.1, 0.25, 0.5, 1, 2, 5, 10].find((metres) => metres * camera.scale >= 45) ?? 20;
  const [left, top] = camera.toMap(0, 0);
  const [right, bottom] = camera.toMap(camera.width, camera.height);
  context.strokeStyle = colour("map-grid");
  context.lineWidth = 1;
  context.beginPath();
  for (let x = Math.ceil(left / step) * step; x < right; x += step) {
    const px = Math.round(camera.toScreen(x, 0)[0]) + 0.5;
    context.moveTo(px, 0);
    context.lineTo(px, camera.height);
  }
  for (let y = Math.ceil(bottom / step) * step; y < top; y += step) {
    const py = Math.round(camera.toScreen(0, y)[1]) + 0.5;
    context.moveTo(0, py);
    context.lineTo(camera.width, py);
  }
  context.stroke();
  const length = step * camera.scale;
  context.fillStyle = context.strokeStyle = colour("muted");
  context.lineWidth = 2;
  context.beginPath();
  const baseline = camera.height - 14;
  context.moveTo(14, baseline - 5);
  context.lineTo(14, baseline);
  context.lineTo(14 + length, baseline);
  context.lineTo(14 + length, baseline - 5);
  context.stroke();
  context.font = "12px Roboto, sans-serif";
  context.fillText(`${step} m`, 18, baseline - 5);
}

// `points` is x, y, x, y, ... [m]; `name` is a colour of the style sheet.
export function drawPoints(context, camera, points, name, size) {
  context.fillStyle = colour(name);
  for (let k = 0; k + 1 < points.length; k += 2) {
    const [px, py] = camera.toScreen(points[k], points[k + 1]);
    context.fillRect(px - size / 2, py - size / 2, size, size);
  }
}

export function drawLine(context, camera, points, name, width, longest_m = Infinity) {
  if (points.length < 4) return;
  context.strokeStyle = colour(name);
  context.lineWidth = width;
  context.lineJoin = "round";
  context.beginPath();
  for (let k = 0; k + 1 < points.length; k += 2) {
    const isJump = k > 0 && Math.hypot(points[k] - points[k - 2], points[k + 1] - points[k - 1]) > longest_m;
    context[isJump ? "moveTo" : "lineTo"](...camera.toScreen(points[k], points[k + 1]));
  }
  context.stroke();
}

// Positions by GPS, x, y, x, y, ... [m], and the standard deviation of the newest one [m].
export function drawGps(context, camera, points, std_m) {
  if (points.length < 2) return;
  drawPoints(context, camera, points, "gps", 4);
  const [px, py] = camera.toScreen(points.at(-2), points.at(-1));
  context.strokeStyle = colour("gps");
  context.lineWidth = 1.5;
  context.beginPath();
  context.arc(px, py, Math.max(4, std_m * camera.scale), 0, 2 * Math.PI);
  context.stroke();
}

// `particles` is x, y, heading, ... [m, rad].
export function drawParticles(context, camera, particles) {
  context.strokeStyle = colour("particles");
  context.lineWidth = 1;
  const length = 9;
  context.beginPath();
  for (let k = 0; k + 2 < particles.length; k += 3) {
    const [px, py] = camera.toScreen(particles[k], particles[k + 1]);
    context.moveTo(px, py);
    context.lineTo(px + length * Math.cos(particles[k + 2]), py - length * Math.sin(particles[k + 2]));
  }
  context.stroke();
}

// `footprint` is the robot's outline in its own frame: [x, y] [m].
export function drawRobot(context, camera, [x, y, theta], footprint) {
  const [px, py] = camera.toScreen(x, y);
  context.save();
  context.translate(px, py);
  context.rotate(-theta);
  context.beginPath();
  for (const [vx, vy] of footprint) context.lineTo(vx * camera.scale, -vy * camera.scale);
  context.closePath();
  context.fillStyle = colour("robot");
  context.strokeStyle = colour("robot-edge");
  context.lineWidth = 1.5;
  context.fill();
  context.stroke();
  const front = Math.max(...footprint.map(([vx]) => vx)) * camera.scale;
  context.beginPath(); // an arrowhead that points forward
  context.moveTo(front * 0.85, 0);
  context.lineTo(front * 0.3, -front * 0.32);
  context.lineTo(front * 0.3, front * 0.32);
  context.closePath();
  context.fillStyle = colour("robot-nose");
  context.fill();
  context.restore();
}

// The floor that tuning needs: `length_m` ahead of the robot at a pose, and as much behind.
export function drawLane(context, camera, [x, y, theta], length_m) {
  context.save();
  context.translate(...camera.toScreen(x, y));
  context.rotate(-theta);
  context.strokeStyle = colour("warn");
  context.lineWidth = 2;
  context.setLineDash([8, 5]);
  const [half, side] = [length_m, LANE_WIDTH_M / 2].map((metres) => metres * camera.scale);
  context.strokeRect(-half, -side, 2 * half, 2 * side);
  context.restore();
}

// A circle with an arrow along `theta`, or with a dot if `theta` is null.
export function drawArrow(context, camera, x, y, theta, name, label = "") {
  const [px, py] = camera.toScreen(x, y);
  context.save();
  context.translate(px, py);
  context.fillStyle = context.strokeStyle = colour(name);
  context.lineWidth = 3;
  context.beginPath();
  context.arc(0, 0, 7, 0, 2 * Math.PI);
  context.stroke();
  if (theta !== null) {
    context.rotate(-theta);
    context.beginPath();
    context.moveTo(7, 0);
    context.lineTo(30, 0);
    context.stroke();
    context.beginPath();
    context.moveTo(40, 0);
    context.lineTo(27, -7);
    context.lineTo(27, 7);
    context.fill();
    context.rotate(theta);
  } else {
    context.beginPath();
    context.arc(0, 0, 2.5, 0, 2 * Math.PI);
    context.fill();
  }
  if (label) {
    context.font = "bold 13px Roboto, sans-serif";
    context.fillText(label, 11, -9);
  }
  context.restore();
}

export function drawCrosshair(context, px, py) {
  context.strokeStyle = colour("text");
  context.lineWidth = 1.5;
  context.beginPath();
  for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
    context.moveTo(px + 4 * dx, py + 4 * dy);
    context.lineTo(px + 14 * dx, py + 14 * dy);
  }
  context.stroke();
}
