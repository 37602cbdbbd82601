// How each layer of the map is drawn. The context's unit is the pixel; `camera` turns metres into them.

import { colour } from "./colours.js";

export const LAYERS = [
  ["map", "Map"],
  ["local_costmap", "Costmap"],
  ["particles", "Particles"],
  ["plan", "Plan"],
  ["local_plan", "Local plan"],
  ["trail", "Trail"],
  ["scan", "Scan"],
  ["footprint", "Robot"],
];

function mix(a, b, share) {
  return a.map((value, k) => Math.round(value + share * (b[k] - value)));
}

function rgb(name) {
  const hex = colour(name).replace("#", "");
  return [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
}

// Pixel of the PNG (0 unknown, 1...101 occupancy) -> RGBA.
export function mapPalette() {
  const table = new Uint8ClampedArray(256 * 4);
  const free = rgb("map-free");
  const wall = rgb("map-wall");
  for (let value = 1; value <= 101; value += 1) {
    table.set([...mix(free, wall, (value - 1) / 100), 255], 4 * value);
  }
  return table;
}

export function costPalette() {
  const table = new Uint8ClampedArray(256 * 4);
  const low = rgb("cost-low");
  const high = rgb("cost-high");
  for (let value = 2; value <= 101; value += 1) {
    const share = (value - 1) / 100;
    table.set([...mix(low, high, share), Math.round(15 + 110 * share ** 2)], 4 * value);
  }
  return table;
}

export async function gridImage({ place, cells }, palette) {
  const bitmap = await createImageBitmap(new Blob([cells], { type: "image/png" }), {
    colorSpaceConversion: "none",
  });
  const canvas = document.createElement("canvas");
  canvas.width = place.columns;
  canvas.height = place.rows;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(bitmap, 0, 0);
  const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
  const known = { left: place.columns, right: 0, low: place.rows, high: 0 }; // in cells
  for (let k = 0; k < pixels.data.length; k += 4) {
    const from = 4 * pixels.data[k];
    if (from) {
      const column = (k / 4) % place.columns;
      const row = Math.floor(k / 4 / place.columns);
      known.left = Math.min(known.left, column);
      known.right = Math.max(known.right, column + 1);
      known.low = Math.min(known.low, row);
      known.high = Math.max(known.high, row + 1);
    }
    pixels.data.set(palette.subarray(from, from + 4), k);
  }
  context.putImageData(pixels, 0, 0);
  // PNG rows go down, grid rows go up.
  const upright = document.createElement("canvas");
  upright.width = canvas.width;
  upright.height = canvas.height;
  const turned = upright.getContext("2d");
  turned.translate(0, canvas.height);
  turned.scale(1, -1);
  turned.drawImage(canvas, 0, 0);
  return { image: upright, place, known };
}

export function drawGrid(context, camera, { image, place }) {
  const [x, y] = place.origin;
  const [px, py] = camera.toScreen(x, y);
  const cell = place.resolution_m * camera.scale;
  context.save();
  context.imageSmoothingEnabled = false;
  context.translate(px, py);
  context.drawImage(image, 0, -place.rows * cell, place.columns * cell, place.rows * cell);
  context.restore();
}

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
  const long = step * camera.scale;
  context.fillStyle = context.strokeStyle = colour("muted");
  context.lineWidth = 2;
  context.beginPath();
  const base = camera.height - 14;
  context.moveTo(14, base - 5);
  context.lineTo(14, base);
  context.lineTo(14 + long, base);
  context.lineTo(14 + long, base - 5);
  context.stroke();
  context.font = "12px Roboto, sans-serif";
  context.fillText(`${step} m`, 18, base - 5);
}

export function drawPoints(context, camera, points, name, size) {
  context.fillStyle = colour(name);
  for (let k = 0; k + 1 < points.length; k += 2) {
    const [px, py] = camera.toScreen(points[k], points[k + 1]);
    context.fillRect(px - size / 2, py - size / 2, size, size);
  }
}

export function drawLine(context, camera, points, name, width, dash = []) {
  if (points.length < 4) return;
  context.strokeStyle = colour(name);
  context.lineWidth = width;
  context.lineJoin = "round";
  context.setLineDash(dash);
  context.beginPath();
  for (let k = 0; k + 1 < points.length; k += 2) context.lineTo(...camera.toScreen(points[k], points[k + 1]));
  context.stroke();
  context.setLineDash([]);
}

export function drawParticles(context, camera, particles) {
  context.strokeStyle = colour("particles");
  context.lineWidth = 1;
  const long = 9;
  context.beginPath();
  for (let k = 0; k + 2 < particles.length; k += 3) {
    const [px, py] = camera.toScreen(particles[k], particles[k + 1]);
    context.moveTo(px, py);
    context.lineTo(px + long * Math.cos(particles[k + 2]), py - long * Math.sin(particles[k + 2]));
  }
  context.stroke();
}

export function drawRobot(context, camera, [x, y, theta], outline) {
  const [px, py] = camera.toScreen(x, y);
  context.save();
  context.translate(px, py);
  context.rotate(-theta);
  context.beginPath();
  for (const [vx, vy] of outline) context.lineTo(vx * camera.scale, -vy * camera.scale);
  context.closePath();
  context.fillStyle = colour("robot");
  context.strokeStyle = colour("robot-edge");
  context.lineWidth = 1.5;
  context.fill();
  context.stroke();
  const nose = Math.max(...outline.map(([vx]) => vx)) * camera.scale;
  context.beginPath(); // an arrowhead: which way is forward
  context.moveTo(nose * 0.85, 0);
  context.lineTo(nose * 0.3, -nose * 0.32);
  context.lineTo(nose * 0.3, nose * 0.32);
  context.closePath();
  context.fillStyle = colour("robot-nose");
  context.fill();
  context.restore();
}

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
