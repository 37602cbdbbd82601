// Drives the robot about while nobody else does: ahead where there is space, else towards the wider side.

const SPEED_M_S = 0.35, TURN_RAD_S = 1.1;
const NEAR_M = 0.6, FAR_M = 1.0;

export class Wanderer {
  constructor(lidar) {
    this.lidar = lidar;
    this.turning = 0;  // +1 left, -1 right, 0 not
  }

  /** Return the wanted motion of the body. */
  twist() {
    const ahead_m = this.lidar.nearest_m(-0.5, 0.5);
    if (this.turning !== 0 && ahead_m > FAR_M) this.turning = 0;
    const left_m = this.lidar.nearest_m(0.3, 1.2), right_m = this.lidar.nearest_m(-1.2, -0.3);
    if (this.turning === 0 && ahead_m < NEAR_M) this.turning = left_m > right_m ? 1 : -1;
    if (this.turning !== 0) return { v_m_s: 0, w_rad_s: this.turning * TURN_RAD_S };
    const steer = Math.max(-0.5, Math.min(0.5, 0.5 * (left_m - right_m)));
    return { v_m_s: SPEED_M_S, w_rad_s: steer };
  }
}
