"""One set of gains for the board from its identified wheels, and what it promises."""

from dataclasses import dataclass, replace
from typing import Annotated

from annotated_types import Ge, Gt, Le, Lt

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper_tuning.design.fixed_point import NOMINAL_V, BoardGains, on_the_wire
from thumper_tuning.design.loop_analysis import LoopFigures, Plant, StepFigures, judge, judge_step
from thumper_tuning.design.plant_family import worst
from thumper_tuning.design.tuning_rules import RULES, PiGains, migo, pole_placement
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.motor import Identified
from thumper_tuning.logs.motor_log import DriveUnit

FULL_PWM = 255.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions:
    """What to design for."""

    rule: str = "migo"
    largest_sensitivity: Annotated[float, Ge(1.05), Le(3)] = 1.6  # of migo
    natural_rad_s: Annotated[float, Gt(0)] = 8.0  # of pole-placement
    damping: Annotated[float, Gt(0), Lt(1)] = 0.8  # of pole-placement
    period_s: Annotated[float, Gt(0)] = 0.1
    feed_forward: bool = True
    acceleration_rad_s2: Annotated[float, Ge(0), Le(200)] = 8.0
    manual: PiGains | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Gains on the wire's grid, and the figures of the loop with exactly these."""

    gains: BoardGains
    model: MotorModel  # the wheels' mean at 7.4 V, in PWM
    uncertainty: Uncertainty
    period_s: float
    loop: LoopFigures
    step: StepFigures
    worst: LoopFigures


def nominal(motors: list[Identified], battery_V: float | None = None) -> tuple[MotorModel, Uncertainty]:
    """The wheels' mean in PWM at 7.4 V: one set of gains serves both.

    A log in volts gives the PWM at 7.4 V directly; one in PWM needs the battery's voltage, from the log's own
    battery_V column or given; without either it is taken for 7.4 V.
    """
    scaled = []
    for motor in motors:
        supply_V = battery_V or motor.supply_V or NOMINAL_V
        pwm_per_unit = FULL_PWM / NOMINAL_V if motor.unit is DriveUnit.VOLT else supply_V / NOMINAL_V
        model, std = motor.model, motor.uncertainty
        scaled.append(
            (
                replace(
                    model,
                    gain=model.gain / pwm_per_unit,
                    friction_forward=model.friction_forward * pwm_per_unit,
                    friction_backward=model.friction_backward * pwm_per_unit,
                ),
                replace(std, gain=std.gain / pwm_per_unit, friction=std.friction * pwm_per_unit),
            )
        )

    def mean(values: list[float]) -> float:
        return sum(values) / len(values)

    models, stds = [model for model, _ in scaled], [std for _, std in scaled]
    return (
        replace(
            models[0],
            gain=mean([m.gain for m in models]),
            time_constant_s=mean([m.time_constant_s for m in models]),
            friction_forward=mean([m.friction_forward for m in models]),
            friction_backward=mean([m.friction_backward for m in models]),
            delay_s=mean([m.delay_s for m in models]),
        ),
        max(stds, key=lambda std: std.gain),
    )


def design(model: MotorModel, std: Uncertainty, options: DesignOptions) -> Design:
    """Gains by the chosen rule, rounded, judged.

    Raises
    ------
    ThumperError
        No such rule, gains that do not fit the board, or a loop that is not stable.
    """
    plant = Plant.of(model, options.period_s)
    pi = _gains(model, plant, options)
    kv = 1.0 / model.gain
    gains = on_the_wire(
        kp=pi.kp,
        ki=pi.ki,
        ks=max(model.friction, 0.0) if options.feed_forward else 0.0,
        kv=kv if options.feed_forward else 0.0,
        ka=kv * model.time_constant_s if options.feed_forward else 0.0,
        acceleration=options.acceleration_rad_s2,
    )
    loop = judge(plant, gains.kp, gains.ki)
    if not loop.stable:
        raise ThumperError(
            f"kp {gains.kp:.4g}, ki {gains.ki:.4g} make the loop unstable; choose smaller gains"
        )
    return Design(
        gains=gains,
        model=model,
        uncertainty=std,
        period_s=options.period_s,
        loop=loop,
        step=judge_step(plant, gains.kp, gains.ki),
        worst=worst(model, std, gains.kp, gains.ki, options.period_s),
    )


def _gains(model: MotorModel, plant: Plant, options: DesignOptions) -> PiGains:
    if options.manual is not None:
        return options.manual
    if options.rule == "migo":
        return migo(plant, options.largest_sensitivity)
    if options.rule == "pole-placement":
        return pole_placement(plant, options.natural_rad_s, options.damping)
    if options.rule not in RULES:
        raise ThumperError(f"no rule {options.rule!r}; there are: {', '.join(RULES)}", exit_code=EXIT_USAGE)
    return RULES[options.rule](model, options.period_s)
