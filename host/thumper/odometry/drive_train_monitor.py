"""Compare the wheels, as estimated while driving, with the model that the board's gains were designed for."""

from dataclasses import dataclass

from thumper.odometry.drive_train import DriveTrainEstimate, DriveTrainEstimator, WheelEstimate, WheelTick

PERIOD_TICKS = 50  # between two comparisons
SIGMAS = 4.0
FRICTION_SHARE, LEAST_FRICTION_PWM = 0.3, 6.0
GAIN_SHARE, TIME_CONSTANT_SHARE = 0.1, 0.3
TUNE = "run `thumper tune`"


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardWheelModel:
    """The board's model of a wheel: `ks` [PWM], `kv` [PWM/(rad/s)] and `ka` [PWM/(rad/s^2)]."""

    ks: float
    kv: float
    ka: float


class DriveTrainMonitor:
    """Estimates the wheels, and says how they differ from the board's model. Never raises."""

    def __init__(
        self, *, counts_per_rev: float, pwm_frequency_Hz: float, feed_forward: BoardWheelModel | None = None
    ) -> None:
        self._estimator = DriveTrainEstimator(counts_per_rev=counts_per_rev, delay_s=0.5 / pwm_frequency_Hz)
        self.feed_forward = feed_forward
        self.estimate: DriveTrainEstimate | None = None
        self._ticks = 0
        self._works = True

    def add(self, tick: WheelTick) -> None:
        """Add the next tick."""
        if not self._works:
            return
        try:
            self._estimator.add(tick)
            self._ticks += 1
            if self._ticks % PERIOD_TICKS == 0:
                self.estimate = self._estimator.estimate()
        except Exception:  # whatever fails here, the robot must go on
            self._works, self.estimate = False, None

    def drift_lines(self) -> list[str]:
        """Return one line if the wheels differ from the board's model, else none."""
        if self.estimate is None or self.feed_forward is None or self.feed_forward.kv <= 0.0:
            return []
        parts = drifts(self.estimate.mean, self.feed_forward)
        return [f"{'; '.join(parts)}; check the wheels and the battery, then {TUNE}"] if parts else []


def drifts(wheels: WheelEstimate, model: BoardWheelModel) -> list[str]:
    """Return how the wheels differ from the model by more than noise and usual spread, one text each."""
    found = []
    if (friction := wheels.friction) is not None:
        limit_pwm = max(SIGMAS * friction.std, FRICTION_SHARE * model.ks, LEAST_FRICTION_PWM)
        if abs(friction.value - model.ks) > limit_pwm:
            cause = "a wheel drags" if friction.value > model.ks else "they run easier"
            found.append(
                f"the wheels need {friction.value:.0f} PWM against friction, ks is {model.ks:.0f}: {cause}"
            )
    if (gain := wheels.gain) is not None:
        ratio, std = gain.value * model.kv, gain.std * model.kv
        if abs(ratio - 1.0) > max(SIGMAS * std, GAIN_SHARE):
            word = "faster" if ratio > 1.0 else "slower"
            found.append(f"they turn {100 * abs(ratio - 1.0):.0f} % {word} than kv says")
    if (lag := wheels.time_constant_s) is not None and model.ka > 0.0:
        model_s = model.ka / model.kv
        if abs(lag.value - model_s) > max(SIGMAS * lag.std, TIME_CONSTANT_SHARE * model_s):
            found.append(
                f"their time constant is {1e3 * lag.value:.0f} ms, by ka and kv {1e3 * model_s:.0f} ms: "
                "the load or the number of working motors changed"
            )
    return found
