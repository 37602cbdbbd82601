"""The speed loop as python-control systems: open and closed loop, margins, step response, poles.

Plant: y[k+1] = a y[k] + c0 u[k] + c1 u[k-1] + ...; control law of the board: u[k] = Kp e[k] + I[k],
I[k] = I[k-1] + Ki e[k].
"""

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.design.plant import ComplexArray, Plant

if TYPE_CHECKING:
    import control

STEP_DURATION_S = 6.0
SLOWEST = 3e-4  # least frequency that is computed, of the Nyquist frequency


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopMargins:
    """Stability margins of a loop. The distance 1 / Ms to -1 is the S-based disk margin."""

    stable: bool
    max_sensitivity: float  # Ms, the maximum of |1 / (1 + L)|; infinite if unstable
    max_complementary: float  # Mt, the maximum of |L / (1 + L)|
    gain_margin: float  # factor
    phase_margin_deg: float
    delay_margin_s: float
    disk_gain_margin: float  # factor; gain and phase may change at the same time
    disk_phase_margin_deg: float

    @property
    def gain_margin_dB(self) -> float:
        """The gain margin as a level; minus infinity if the loop is unstable."""
        return 20.0 * math.log10(self.gain_margin) if self.gain_margin > 0.0 else -math.inf


UNSTABLE = LoopMargins(
    stable=False,
    max_sensitivity=math.inf,
    max_complementary=math.inf,
    gain_margin=0.0,
    phase_margin_deg=0.0,
    delay_margin_s=0.0,
    disk_gain_margin=1.0,
    disk_phase_margin_deg=0.0,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StepInfo:
    """Characteristics of the linear response to a unit step of the set-point."""

    rise_time_s: float  # 10 to 90 %
    settling_time_s: float  # to within 2 %
    overshoot_percent: float
    itae: float  # integral of time times absolute error [s^2]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLoop:
    """Plant and controller; the loops are built with `control.series` and `control.feedback`."""

    plant: "control.TransferFunction"
    controller: "control.TransferFunction"

    @classmethod
    def of_board(cls, plant: Plant, kp: float, ki: float) -> "SpeedLoop":
        """Return the loop of the board's PI."""
        import control

        law = control.tf([kp + ki, -kp], [1.0, -1.0], plant.period_s, inputs=["e"], outputs=["u"], name="PI")
        return cls(plant=plant.system(), controller=law)

    @property
    def period_s(self) -> float:
        """Period of the control tick."""
        return float(self.plant.dt)

    @property
    def open_loop(self) -> "control.TransferFunction":
        """L = P C."""
        import control

        return control.tf(control.series(self.controller, self.plant), name="L")

    @property
    def closed_loop(self) -> "control.TransferFunction":
        """T = L / (1 + L), from set-point to counted speed."""
        import control

        return control.tf(control.feedback(self.open_loop, 1), name="T")

    @property
    def sensitivity(self) -> "control.TransferFunction":
        """S = 1 / (1 + L)."""
        import control

        return control.tf(control.feedback(1, self.open_loop), name="S")

    @property
    def load_response(self) -> "control.TransferFunction":
        """P / (1 + L), from a load in PWM to counted speed."""
        import control

        return control.tf(control.feedback(self.plant, self.controller), name="P S")

    def poles(self) -> ComplexArray:
        """Return the closed-loop poles."""
        poles: ComplexArray = self.closed_loop.poles()
        return poles

    def is_stable(self) -> bool:
        """Return whether all closed-loop poles are inside the unit circle."""
        return bool(np.all(np.abs(self.poles()) < 1.0 - 1e-9))

    def damping(self) -> tuple[FloatArray, FloatArray]:
        """Return natural frequency [rad/s] and damping ratio of each closed-loop pole."""
        import control

        natural_rad_s, ratio, _ = control.damp(self.closed_loop, doprint=False)
        return natural_rad_s, ratio

    def frequencies(self) -> FloatArray:
        """Return frequencies up to the Nyquist frequency [rad/s]."""
        nyquist = math.pi / self.period_s
        result: FloatArray = np.concatenate(
            (
                np.geomspace(SLOWEST, 0.1, 80, endpoint=False) * nyquist,
                np.linspace(0.1, 0.9999, 320) * nyquist,
            )
        )
        return result

    def margins(self) -> LoopMargins:
        """Return the margins by `control.stability_margins` and `control.disk_margins`."""
        import control

        if not self.is_stable():
            return UNSTABLE
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the last frequency of disk_margins is rounded above Nyquist
            gains, phases_deg, distances, gains_rad_s, crossovers_rad_s, _ = control.stability_margins(
                self.open_loop, returnall=True
            )
            at_nyquist = -float(np.real(self.open_loop(-1.0)))
            _, disk_dB, disk_deg = control.disk_margins(self.open_loop, self.frequencies())
        gains = gains[
            gains_rad_s > SLOWEST * math.pi / self.period_s
        ]  # not the false one of the integrator's pole
        gain = gains[np.argmin(np.abs(np.log(gains)))] if gains.size else math.inf
        if at_nyquist > 0.0:  # L is real there: a crossing that stability_margins leaves out
            gain = min(gain, 1.0 / at_nyquist)
        T, _, _ = control.frequency_response(self.closed_loop, self.frequencies())
        S, _, _ = control.frequency_response(self.sensitivity, self.frequencies())
        crossovers = [
            (phase_deg, rad_s)
            for phase_deg, rad_s in zip(phases_deg.tolist(), crossovers_rad_s.tolist(), strict=True)
            if math.isfinite(phase_deg) and rad_s > 0.0
        ]
        return LoopMargins(
            stable=True,
            # For a few discrete loops, stability_margins uses a coarse grid and misses the maximum of |S|.
            max_sensitivity=max(1.0 / float(np.min(distances, initial=math.inf)), float(np.max(S))),
            max_complementary=float(np.max(T)),
            gain_margin=float(gain),
            phase_margin_deg=min((phase_deg for phase_deg, _ in crossovers), key=abs, default=180.0),
            delay_margin_s=min(
                (math.radians(phase_deg % 360.0) / rad_s for phase_deg, rad_s in crossovers), default=math.inf
            ),
            disk_gain_margin=float(control.db2mag(disk_dB)),
            disk_phase_margin_deg=float(disk_deg),
        )

    def step_response(self, ticks: int, *, load_pwm: float = 0.0) -> "control.TimeResponseData":
        """Return the counted speed after a unit step of the set-point, or after a step of the load."""
        import control

        system = -load_pwm * self.load_response if load_pwm else self.closed_loop
        return control.step_response(system, np.arange(ticks + 1) * self.period_s)

    def step_info(self) -> StepInfo:
        """Return the characteristics of the step response by `control.step_info`, sampled once per tick."""
        import control

        time_s = np.arange(round(STEP_DURATION_S / self.period_s) + 1) * self.period_s
        y = np.asarray(self.step_response(len(time_s) - 1).outputs, dtype=float).ravel()
        itae = float(np.sum(time_s * np.abs(1.0 - y)) * self.period_s)
        if y.max() < 0.9:  # step_info needs a response that gets there
            return StepInfo(rise_time_s=math.inf, settling_time_s=math.inf, overshoot_percent=0.0, itae=itae)
        info = control.step_info(y, T=time_s, yfinal=1.0, SettlingTimeThreshold=0.02)
        return StepInfo(
            rise_time_s=float(info["RiseTime"]),
            settling_time_s=float(info["SettlingTime"]),
            overshoot_percent=float(info["Overshoot"]),
            itae=itae,
        )
