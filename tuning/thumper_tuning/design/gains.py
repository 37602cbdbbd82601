"""Design one set of gains for the board from its identified wheels, and analyze the loop with them."""

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_tuning.design.fixed_point import BoardGains, to_fixed_point
from thumper_tuning.design.loops import LoopMargins, SpeedLoop, StepInfo
from thumper_tuning.design.plant import Plant
from thumper_tuning.design.plant_family import worst_case_margins
from thumper_tuning.design.state_feedback import dlqr
from thumper_tuning.design.tuning_rules import RULES, PiGains, migo, pole_placement
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.logs.motor_log import DriveUnit
from thumper_tuning.logs.units import FULL_PWM, NOMINAL_V

RULE_NAMES = (*RULES, "dlqr")


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions:
    """Options of the design."""

    rule: str = "migo"
    largest_sensitivity: Annotated[float, Ge(1.05), Le(3)] = 1.6  # of migo and dlqr
    natural_rad_s: Annotated[float, Gt(0)] = 8.0  # of pole-placement
    damping: Annotated[float, Gt(0), Lt(1)] = 0.8  # of pole-placement
    period_s: Annotated[float, Gt(0)] = 0.1
    feed_forward: bool = True
    acceleration_rad_s2: Annotated[float, Ge(0), Le(200)] = 8.0
    manual: PiGains | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Gains in fixed point, and the loop's characteristics with exactly these."""

    gains: BoardGains
    model: MotorModel  # mean of the wheels at 7.4 V, in PWM
    uncertainty: Uncertainty
    period_s: float
    margins: LoopMargins
    worst_case: LoopMargins  # of the plant family
    step_info: StepInfo

    @property
    def plant(self) -> Plant:
        """The mean wheel as the board counts it."""
        return Plant.from_model(self.model, self.period_s)

    @property
    def loop(self) -> SpeedLoop:
        """The loop of plant and board as python-control systems."""
        return SpeedLoop.of_board(self.plant, self.gains.kp, self.gains.ki)


def nominal_model(
    motors: list[IdentifiedMotor], battery_V: float | None = None
) -> tuple[MotorModel, Uncertainty]:
    """Return the mean of the wheels in PWM at 7.4 V: one set of gains controls both.

    A log in volts gives the PWM at 7.4 V directly. A log in PWM needs the battery voltage: `battery_V`, else
    the log's own battery_V column, else 7.4 V.
    """
    models, stds = [], []
    for motor in motors:
        supply_V = battery_V or motor.supply_V or NOMINAL_V
        pwm_per_unit = FULL_PWM / NOMINAL_V if motor.unit is DriveUnit.VOLT else supply_V / NOMINAL_V
        model, std = motor.model, motor.uncertainty
        models.append(
            replace(
                model,
                gain=model.gain / pwm_per_unit,
                friction_forward=model.friction_forward * pwm_per_unit,
                friction_backward=model.friction_backward * pwm_per_unit,
            )
        )
        stds.append(replace(std, gain=std.gain / pwm_per_unit, friction=std.friction * pwm_per_unit))
    return _mean(models), max(stds, key=lambda std: std.gain)


def _mean(models: list[MotorModel]) -> MotorModel:
    def mean(values: list[float]) -> float:
        return sum(values) / len(values)

    return replace(
        models[0],
        gain=mean([m.gain for m in models]),
        time_constant_s=mean([m.time_constant_s for m in models]),
        friction_forward=mean([m.friction_forward for m in models]),
        friction_backward=mean([m.friction_backward for m in models]),
        delay_s=mean([m.delay_s for m in models]),
    )


def design(model: MotorModel, std: Uncertainty, options: DesignOptions) -> Design:
    """Compute gains by the chosen rule, round them, and analyze the loop.

    Raises
    ------
    ThumperError
        Unknown rule, gains out of the board's range, or an unstable loop.
    """
    plant = Plant.from_model(model, options.period_s)
    pi = _pi_gains(model, plant, options)
    kv = 1.0 / model.gain
    gains = to_fixed_point(
        kp=pi.kp,
        ki=pi.ki,
        ks=max(model.friction, 0.0) if options.feed_forward else 0.0,
        kv=kv if options.feed_forward else 0.0,
        ka=kv * model.time_constant_s if options.feed_forward else 0.0,
        acceleration=options.acceleration_rad_s2,
    )
    loop = SpeedLoop.of_board(plant, gains.kp, gains.ki)
    margins = loop.margins()
    if not margins.stable:
        raise ThumperError(
            f"kp {gains.kp:.4g}, ki {gains.ki:.4g} make the loop unstable; choose smaller gains"
        )
    return Design(
        gains=gains,
        model=model,
        uncertainty=std,
        period_s=options.period_s,
        margins=margins,
        worst_case=worst_case_margins(model, std, gains.kp, gains.ki, options.period_s),
        step_info=loop.step_info(),
    )


def _pi_gains(model: MotorModel, plant: Plant, options: DesignOptions) -> PiGains:
    if options.manual is not None:
        return options.manual
    if options.rule == "migo":
        return migo(plant, options.largest_sensitivity)
    if options.rule == "dlqr":
        return dlqr(plant, options.largest_sensitivity)
    if options.rule == "pole-placement":
        return pole_placement(plant, options.natural_rad_s, options.damping)
    if options.rule not in RULES:
        raise ThumperError(
            f"unknown rule {options.rule!r}; choose from: {', '.join(RULE_NAMES)}", exit_code=EXIT_USAGE
        )
    return RULES[options.rule](model, options.period_s)
