"""How the robot followed its trapezoids, before and after."""

import numpy as np
from matplotlib.figure import Figure

from thumper_tuning.robot.verify import Verification


def tracking(before: Verification | None, after: Verification) -> Figure:
    """Set-point, speed and PWM of the left wheel; same axes for both sets of gains."""
    runs = [(name, run) for name, run in (("before", before), ("after", after)) if run is not None]
    figure = Figure(figsize=(10.0, 6.4), layout="constrained")
    grid = np.asarray(figure.subplots(3, len(runs), sharex=True, sharey="row", squeeze=False))
    for (name, run), (speed, error, pwm) in zip(runs, grid.T, strict=True):
        rows = run.rows
        time_s = rows[:, 0] - rows[0, 0]
        speed.step(time_s, rows[:, 3], where="pre", color="#7f7f7f", label="set-point")
        speed.plot(time_s, rows[:, 4], ".-", color="#d62728", ms=3, lw=0.8, label="counted")
        speed.set_title(
            f"{name}: kp {run.gains.kp:.3g}, ki {run.gains.ki:.3g}, std "
            + ", ".join(f"{t.std_rad_s:.3f} at {t.acceleration_rad_s2:g}" for t in run.tracking),
            fontsize=9,
        )
        error.plot(time_s, rows[:, 3] - rows[:, 4], ".-", color="#1f77b4", ms=3, lw=0.8)
        pwm.step(time_s, rows[:, 5], where="post", color="#2ca02c", lw=0.9)
        pwm.set_xlabel("time [s]")
        for axes in (speed, error, pwm):
            axes.grid(alpha=0.3)
    grid[0, 0].set_ylabel("left speed [rad/s]")
    grid[1, 0].set_ylabel("set-point - speed [rad/s]")
    grid[2, 0].set_ylabel("PWM")
    grid[0, 0].legend(loc="upper right", fontsize=8)
    return figure
