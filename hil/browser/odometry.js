// The pose that the wheel counts alone give, as the host computes it from telemetry.

export class Odometry {
  constructor(params, pose) {
    this.m_per_count = (2 * Math.PI * params.body.wheel_radius_m) / params.encoder.counts_per_rev;
    this.track_m = params.body.track_m;
    this.pose = pose;
    this.counts = null;
  }

  /** Roll along an arc to new counts (Thrun et al., Probabilistic Robotics, 5.4). */
  update(left, right) {
    const [left_m, right_m] = this.counts
      ? [left - this.counts[0], right - this.counts[1]].map((count) => count * this.m_per_count)
      : [0, 0];
    this.counts = [left, right];
    const { x_m, y_m, yaw_rad } = this.pose;
    const turn_rad = (right_m - left_m) / this.track_m;
    const ahead_m = 0.5 * (left_m + right_m);
    this.pose = {
      x_m: x_m + ahead_m * Math.cos(yaw_rad + 0.5 * turn_rad),
      y_m: y_m + ahead_m * Math.sin(yaw_rad + 0.5 * turn_rad),
      yaw_rad: yaw_rad + turn_rad,
    };
  }
}
