// Where the map is looked at from: metres to pixels and back, pan, zoom, follow.

const NEAREST = 600; // pixels a metre
const FARTHEST = 3;

export class Camera {
  constructor() {
    this.x = 0;
    this.y = 0;
    this.scale = 80; // pixels a metre
    this.width = 1;
    this.height = 1;
    this.touched = false; // the user has chosen what to see: no more fitting by itself
  }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toMap(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  pan(dx, dy) {
    this.touched = true;
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  zoom(factor, px, py) {
    this.touched = true;
    const [x, y] = this.toMap(px, py);
    this.scale = Math.min(NEAREST, Math.max(FARTHEST, this.scale * factor));
    const [nx, ny] = this.toMap(px, py);
    this.x += x - nx;
    this.y += y - ny;
  }

  fit(left, bottom, right, top) {
    const margin = 0.3;
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
    const wide = this.width / (right - left + 2 * margin);
    const high = this.height / (top - bottom + 2 * margin);
    this.scale = Math.min(NEAREST / 2, Math.max(FARTHEST, Math.min(wide, high)));
  }
}
