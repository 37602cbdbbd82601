// A small flat, as walls of straight pieces [m], and what can be asked of it: a beam's length, a touch.

const WIDTH_M = 6, HEIGHT_M = 3.6;
const box = (x0, y0, x1, y1) => [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
const pillar = (x, y, r) =>
  Array.from({ length: 8 }, (_, i) => [x + r * Math.cos((i * Math.PI) / 4), y + r * Math.sin((i * Math.PI) / 4)]);

export const OUTLINE = box(0, 0, WIDTH_M, HEIGHT_M);
/** Corners of each thing in the flat: a wall with a door, furniture, a pillar, the legs of a chair. */
export const OBSTACLES = [
  box(3.75, 0, 3.87, 1.15), box(3.75, 2.25, 3.87, HEIGHT_M),
  box(0, 0, 0.5, 1.1), box(0.7, 3.05, 2.4, HEIGHT_M), box(5.5, 0, 6, 1.6), box(4.6, 3.2, 5.6, HEIGHT_M),
  pillar(2.45, 1.35, 0.17),
  ...[[1.2, 1.85], [1.55, 1.85], [1.2, 2.2], [1.55, 2.2]].map(([x, y]) => box(x, y, x + 0.05, y + 0.05)),
];
export const START = { x_m: 1.2, y_m: 0.75, yaw_rad: 0.25 };
export const SIZE_M = [WIDTH_M, HEIGHT_M];

const edges = (corners) => corners.map((corner, i) => [...corner, ...corners[(i + 1) % corners.length]]);
const WALLS = [OUTLINE, ...OBSTACLES].flatMap(edges);

/** Return the distance [m] from a point to the first wall in a direction. */
export function cast(x_m, y_m, angle_rad) {
  const dx = Math.cos(angle_rad), dy = Math.sin(angle_rad);
  let nearest_m = Infinity;
  for (const [x0, y0, x1, y1] of WALLS) {
    const ex = x1 - x0, ey = y1 - y0;
    const across = dx * ey - dy * ex;
    if (across === 0) continue;
    const distance_m = ((x0 - x_m) * ey - (y0 - y_m) * ex) / across;
    const along = ((x0 - x_m) * dy - (y0 - y_m) * dx) / across;
    if (along >= 0 && along <= 1 && distance_m >= 0) nearest_m = Math.min(nearest_m, distance_m);
  }
  return nearest_m;
}

/** Return the corners of a rectangle round a pose. */
export function footprint({ x_m, y_m, yaw_rad }, { length_m, width_m }) {
  const cos = Math.cos(yaw_rad), sin = Math.sin(yaw_rad);
  return box(-length_m / 2, -width_m / 2, length_m / 2, width_m / 2).map(([x, y]) => [
    x_m + cos * x - sin * y,
    y_m + sin * x + cos * y,
  ]);
}

/** Return whether a polygon touches a wall. Nothing in the flat is small enough to fit inside the robot. */
export function touches(corners) {
  return edges(corners).some((edge) => WALLS.some((wall) => cross(edge, wall)));
}

function cross([ax, ay, bx, by], [cx, cy, dx, dy]) {
  const side = (px, py, qx, qy, x, y) => Math.sign((qx - px) * (y - py) - (qy - py) * (x - px));
  return (
    side(ax, ay, bx, by, cx, cy) !== side(ax, ay, bx, by, dx, dy) &&
    side(cx, cy, dx, dy, ax, ay) !== side(cx, cy, dx, dy, bx, by)
  );
}
