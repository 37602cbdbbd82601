// A lidar like the LD19: ten turns and 4500 points per second, each taken from where the robot is at that moment.
import { cast } from "./room.js";

const POINTS_PER_S = 4500;
const POINTS_PER_TURN = 450;
const NOISE_M = 0.01;

/** Return a normal variate, as a sum of twelve uniform ones. */
function normal() {
  let sum = -6;
  for (let i = 0; i < 12; ++i) sum += Math.random();
  return sum;
}

export class Lidar {
  constructor() {
    this.taken = 0;
    this.turn = [];  // the last turn's points: {bearing_rad, range_m, x_m, y_m}, oldest first
  }

  /** Take the points that are due by `time_s`; return them. */
  advance(time_s, { x_m, y_m, yaw_rad }) {
    const taken = [];
    for (; this.taken < time_s * POINTS_PER_S; ++this.taken) {
      const bearing_rad = -2 * Math.PI * ((this.taken % POINTS_PER_TURN) / POINTS_PER_TURN);  // clockwise
      const angle_rad = yaw_rad + bearing_rad;
      const range_m = cast(x_m, y_m, angle_rad) + NOISE_M * normal();
      taken.push({
        bearing_rad, range_m, x_m: x_m + range_m * Math.cos(angle_rad), y_m: y_m + range_m * Math.sin(angle_rad),
      });
    }
    this.turn.push(...taken);
    this.turn.splice(0, this.turn.length - POINTS_PER_TURN);
    return taken;
  }

  /** Return the shortest range [m] between two angles. */
  nearest_m(from_rad, to_rad) {
    const within = ({ bearing_rad }) => {
      const bearing = bearing_rad < -Math.PI ? bearing_rad + 2 * Math.PI : bearing_rad;
      return bearing >= from_rad && bearing <= to_rad;
    };
    return Math.min(...this.turn.filter(within).map((point) => point.range_m));
  }
}
