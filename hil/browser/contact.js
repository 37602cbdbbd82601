// Keeps the body out of the walls: it is blocked while its wheels keep turning.
import { wrap } from "./drive_train.js";
import { footprint, touches } from "./room.js";

const CLEAR_M = 0.01, CLEAR_RAD = 0.05;  // back off this far to end a contact

export class Contact {
  constructor(drive, outline) {
    this.drive = drive;
    this.outline = outline;
    this.free = drive.pose;
    this.touched_at = null;
  }

  /** Call every few milliseconds: undo a motion of `elapsed_s` into a wall and block its direction. */
  check(elapsed_s) {
    const { pose } = this.drive;
    if (touches(footprint(pose, this.outline))) {
      const { x_m, y_m, yaw_rad } = this.free;
      const ahead_m = (pose.x_m - x_m) * Math.cos(yaw_rad) + (pose.y_m - y_m) * Math.sin(yaw_rad);
      this.drive.held = { v_m_s: ahead_m / elapsed_s, w_rad_s: wrap(pose.yaw_rad - yaw_rad) / elapsed_s };
      this.drive.pose = this.free;
      this.touched_at ??= this.free;
      return;
    }
    this.free = pose;
    if (this.touched_at && isClear(pose, this.touched_at)) {
      this.touched_at = null;
      this.drive.held = null;
    }
  }
}

function isClear(pose, from) {
  const moved_m = Math.hypot(pose.x_m - from.x_m, pose.y_m - from.y_m);
  return moved_m > CLEAR_M || Math.abs(wrap(pose.yaw_rad - from.yaw_rad)) > CLEAR_RAD;
}
