// View of the map: converts metres to pixels and back; pan, zoom, fit.

const MAX_SCALE = 600; // pixels per metre
const MIN_SCALE = 3;
const FIT_MARGIN_M = 0.3;

export class Camera {
  constructor() {
    this.x = 0; // centre of the view in the map frame [m]
    this.y = 0;
    this.scale = 80; // pixels per metre
    this.width = 1; // pixels
    this.height = 1;
    this.userControlled = false; // the user chose a view: do not fit automatically any more
  }

  toScreen(x, y) {
    return [this.width / 2 + (x - this.x) * this.scale, this.height / 2 - (y - this.y) * this.scale];
  }

  toMap(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  pan(dx, dy) {
    this.userControlled = true;
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  // Zoom about a pixel: the point of the map under it stays there.
  zoom(factor, px, py) {
    this.userControlled = true;
    const [x, y] = this.toMap(px, py);
    this.scale = Math.min(MAX_SCALE, Math.max(MIN_SCALE, this.scale * factor));
    const [newX, newY] = this.toMap(px, py);
    this.x += x - newX;
    this.y += y - newY;
  }

  // Show a rectangle of the map [m].
  fit(left, bottom, right, top) {
    this.x = (left + right) / 2;
    this.y = (bottom + top) / 2;
    const horizontal = this.width / (right - left + 2 * FIT_MARGIN_M);
    const vertical = this.height / (top - bottom + 2 * FIT_MARGIN_M);
    this.scale = Math.min(MAX_SCALE / 2, Math.max(MIN_SCALE, Math.min(horizontal, vertical)));
  }
}
