"""Compare identification and design with other methods on the same logs; track with the real firmware.

The recordings are read from $THUMPER_DATA or ../shared/data.
"""

import argparse
import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure, has_data
from benchmarks.shared.identification_methods import OURS, STAIRS, methods
from benchmarks.shared.wheel_plant import COUNT_RAD, Wheel, counted, steps_and_prbs

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray
from thumper_hil.bench import simulation
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.effects.preset import PRESETS
from thumper_tuning.design.fixed_point import PARAMETER_SPECS, BoardGains
from thumper_tuning.design.gains import RULE_NAMES, Design, DesignOptions, design, nominal_model
from thumper_tuning.design.tuning_rules import PiGains
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import record
from thumper_tuning.drive.verify import Verification, VerifyOptions, verify
from thumper_tuning.identify.cross_validation import fit_percent
from thumper_tuning.identify.excitation_checks import UndeterminedError
from thumper_tuning.identify.model import MotorModel, Uncertainty
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.partial import identify_partly
from thumper_tuning.identify.prediction import predict
from thumper_tuning.identify.richer_models import fit_richer_models
from thumper_tuning.identify.segments import LogSegment, split_segments, with_sensor_window
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.read import read_logs

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "motor"
SEEDS = 20
LEAST_PERIOD_S = 0.02  # of the rows for the other methods
LEAST_MOTION = 0.2  # of the most moving run: less says nothing of a model
EMPTY = 0.05  # charge: 6.7 V open-circuit, the lowest that does not stop under load
OTHER_PAIRS = (PiGains(kp=11.6, ki=8.0), PiGains(kp=4.8, ki=7.9))  # more kp; MIGO 1.4
PAIR_SEEDS = range(1, 6)
EXACT = Uncertainty(
    gain=0.0, time_constant_s=0.0, friction=0.0, delay_s=0.0, friction_forward=0.0, friction_backward=0.0
)


def simulated() -> None:
    """Print the worst of 20 seeds at 10 Hz, as errors against the simulated wheel."""
    print("simulated 10 Hz logs, 60 s, worst of 20 seeds: gain [%], time constant [%], friction [PWM]")
    for tau_s in (0.03, 0.075, 0.2, 0.3):
        wheel = Wheel(tau_s=tau_s)
        logs = [_log(wheel, seed) for seed in range(SEEDS)]
        errors_of = {}
        for name, method in methods(STAIRS).items():
            found = np.array([method(log) for log in logs])
            errors = found - (wheel.gain, tau_s, wheel.friction)
            errors[:, :2] *= 100.0 / np.array((wheel.gain, tau_s))
            worst = errors[np.abs(errors).argmax(axis=0), range(3)]
            figures = f"{worst[0]:+7.1f} {worst[1]:+8.1f} {worst[2]:+7.1f}"
            figures = figures.replace("+nan", "   -")
            errors_of[name] = " / ".join(figures.split())
            print(f"  tau {1e3 * tau_s:3.0f} ms  {name:40} {figures}", flush=True)
        (_, found_by_us), *others = errors_of.items()
        figure(f"wheel of {1e3 * tau_s:.0f} ms identified, worst of {SEEDS}: gain, time constant, friction",
               found_by_us, "(%, %, PWM)", aim="+- 2 / +- 5 / +- 2", peers="; ".join(map(": ".join, others)),
               source="same logs, same run")  # fmt: skip
        percents = [identify([log]).validation.fit_percent for log in logs]
        figure(
            f"wheel of {1e3 * tau_s:.0f} ms: held-out speeds predicted, worst",
            f"{min(percents):.1f}",
            "%",
            aim=">= 93",
        )
        print(f"  tau {1e3 * tau_s:3.0f} ms  held-out speeds predicted, worst seed: {min(percents):.1f} %")


def _log(wheel: Wheel, seed: int) -> MotorLog:
    time_s = np.arange(600, dtype=float) * 0.1
    pwm = steps_and_prbs(600, seed)
    position = counted(wheel.drive(time_s, pwm, seed)) * COUNT_RAD
    starts_segment = np.arange(600) == 0
    return MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=pwm,
        starts_segment=starts_segment,
        position_rad=position,
        quantum_rad=COUNT_RAD,
    )


def recorded() -> None:
    """Print the fit of motors that others recorded."""
    steps = [
        read_logs(path, counts_per_rev=1320.0)[0] for path in sorted(DATA.glob("geared-steps-odd/*.csv"))
    ]
    if not has_data(DATA):
        return
    _every_method()
    _single_step()
    _late_speeds()
    motor = identify(steps)
    print(f"geared motor, five steps: held-out tenths {motor.validation.fit_percent:.1f} %")
    held_out, measured = [], []
    for k, log in enumerate(steps):
        model = identify(steps[:k] + steps[k + 1 :])
        for s in split_segments(log):
            held_out.append(
                s.speed_rad_s - predict(with_sensor_window([s], model.fit.sensor_window_s)[0], model.model)
            )
            measured.append(s.speed_rad_s)
    percent = fit_percent(np.concatenate(measured), np.concatenate(held_out))
    print(f"geared motor, each whole step predicted from the four others: {percent:.1f} %")
    figure("recorded geared motor: held-out tenths predicted", f"{motor.validation.fit_percent:.1f}", "%")
    figure("each whole step predicted from the others", f"{percent:.1f}", "%")
    for side in read_logs(next(DATA.glob("drivetrain-sysid/*.json"))):
        motor = identify([side])
        segments, first, parts = list(motor.segments), 0, []
        for s in segments:
            last = first + len(s.speed_rad_s)
            parts.append(f"{fit_percent(s.speed_rad_s, motor.fit.residual_rad_s[first:last]):.1f}")
            first = last
        figure(f"recorded drive train, {side.name}: held-out speeds predicted",
               f"{motor.validation.fit_percent:.1f}", "%")  # fmt: skip
        print(f"drive train {side.name}: ramps and steps {' '.join(parts)} %, held out "
              f"{motor.validation.fit_percent:.1f} %")  # fmt: skip
        for richer in fit_richer_models(segments, motor.fit):
            print(f"  {richer.kind}: held out {richer.fit_percent:.1f} %")


def _every_method() -> None:
    """Print how each method predicts the recorded logs from their drive: all speeds, and the worst run.

    The other methods get rows of 20 ms or more, and their better reading of speeds (instants or means).
    Ours has a delay and a sensor's window as well. Nobody holds anything out here.
    """
    geared = [
        read_logs(path, counts_per_rev=1320.0)[0] for path in sorted(DATA.glob("geared-steps-odd/*.csv"))
    ]
    logs = {
        "geared motor, five steps": _joined(geared),
        "one step": read_logs(DATA / "single-step" / "step_response.csv")[0],
        "SysId Simple, late speeds": read_logs(DATA / "simple-sysid" / "sysid_data.json")[0],
        **{
            f"drive train, {side.name}": side
            for side in read_logs(next(DATA.glob("drivetrain-sysid/*.json")))
        },
    }
    for name, log in logs.items():
        print(f"{name}: gain, time constant [ms], friction, predicted speeds [%]: all, worst run")
        for method_name, method in methods().items():
            try:
                with np.errstate(all="ignore"):
                    model, runs = (
                        _our_model(log) if method_name == OURS else _other_model(method(_thinned(log)), log)
                    )
            except (ThumperError, ValueError, np.linalg.LinAlgError) as error:
                print(f"  {method_name:42} fails: {str(error)[:60]}")
                continue
            whole = fit_percent(*(np.concatenate(part) for part in zip(*runs, strict=True)))
            least = LEAST_MOTION * max(float(np.std(measured)) for measured, _ in runs)
            worst = min(fit_percent(*run) for run in runs if np.std(run[0]) > least)
            print(f"  {method_name:42} {model.gain:8.4g} {1e3 * model.time_constant_s:7.1f} "
                  f"{model.friction:7.3g}   {whole:6.1f} {worst:6.1f}", flush=True)  # fmt: skip


Runs = list[tuple[FloatArray, FloatArray]]  # measured speeds and residuals of each run


def _our_model(log: MotorLog) -> tuple[MotorModel, Runs]:
    try:
        motor = identify([log])
    except UndeterminedError as reason:
        model = identify_partly([log], reason).model
        return model, _runs(with_sensor_window(split_segments(log), _instants(log)), model)
    return motor.model, _runs(list(motor.segments), motor.model)


def _other_model(found: tuple[float, float, float], log: MotorLog) -> tuple[MotorModel, Runs]:
    gain, tau_s, friction = (float(value) for value in found)
    if not (gain > 0.0 and 0.0 < tau_s < 1e3):
        raise ValueError(f"gain {gain:.3g}, time constant {tau_s:.3g} s")
    friction = 0.0 if np.isnan(friction) else friction
    model = MotorModel(
        gain=gain, time_constant_s=tau_s, friction_forward=friction, friction_backward=friction
    )
    readings = [_runs(with_sensor_window(split_segments(log), window_s), model) for window_s in (None, 0.0)]
    return model, min(readings, key=lambda runs: sum(float(residual @ residual) for _, residual in runs))


def _instants(log: MotorLog) -> float | None:
    """Return the sensor's window of instantaneous speeds; None for positions."""
    return 0.0 if log.position_rad is None else None


def _runs(segments: list[LogSegment], model: MotorModel) -> Runs:
    runs = []
    for s in segments:
        y = s.speed_rad_s
        plausible = np.abs(y) <= 1.25 * np.percentile(np.abs(y), 95)  # two speeds of one log are glitches
        runs.append((y[plausible], (y - predict(s, model))[plausible]))
    return runs


def _joined(logs: list[MotorLog]) -> MotorLog:
    """Return several runs of speeds as one log, one after the other in time."""
    starts_s = np.concatenate(([0.0], np.cumsum([log.time_s[-1] - log.time_s[0] + 1.0 for log in logs])))
    return replace(
        logs[0],
        time_s=np.concatenate(
            [log.time_s - log.time_s[0] + t for log, t in zip(logs, starts_s, strict=False)]
        ),
        drive=np.concatenate([log.drive for log in logs]),
        starts_segment=np.concatenate([log.starts_segment for log in logs]),
        speed_rad_s=np.concatenate([log.speed_rad_s for log in logs if log.speed_rad_s is not None]),
    )


def _thinned(log: MotorLog) -> MotorLog:
    """Return every n-th row: the derivatives of the other methods need rows of 20 ms or more."""
    every = max(round(LEAST_PERIOD_S / log.period_s), 1)
    starts = np.flatnonzero(log.starts_segment)
    kept = np.concatenate([rows[::every] for rows in np.split(np.arange(len(log.time_s)), starts[1:])])
    return replace(
        log,
        time_s=log.time_s[kept],
        drive=log.drive[kept],
        starts_segment=log.starts_segment[kept],
        position_rad=None if log.position_rad is None else log.position_rad[kept],
        speed_rad_s=None if log.speed_rad_s is None else log.speed_rad_s[kept],
    )


def _single_step() -> None:
    """Print what one step of full power determines."""
    logs = read_logs(DATA / "single-step" / "step_response.csv")
    try:
        identify(logs)
    except UndeterminedError as reason:
        motor = identify_partly(logs, reason)
        found = f"{1e3 * motor.time_constant_s:.0f} +- {1e3 * motor.time_constant_std_s:.0f}"
        figure("one recorded step of full power: time constant", found, "ms", aim="60 to 110")
        figure("speed there", f"{motor.steady[0].speed_rad_s:.1f}", "rad/s", aim="11.4 +- 0.1")


def _late_speeds() -> None:
    """Print how a fit to both ramps and one step predicts the other step, and with that step's own delay."""
    (log,) = read_logs(DATA / "simple-sysid" / "sysid_data.json")
    assert log.speed_rad_s is not None
    edges = np.append(np.flatnonzero(log.starts_segment), len(log.time_s))  # two ramps, two steps
    for held_out in (2, 3):
        inside = np.zeros(len(log.time_s), dtype=bool)
        inside[edges[held_out] : edges[held_out + 1]] = True
        rest, alone = (
            replace(
                log,
                time_s=log.time_s[rows],
                drive=log.drive[rows],
                starts_segment=log.starts_segment[rows],
                speed_rad_s=log.speed_rad_s[rows],
            )
            for rows in (~inside, inside)
        )
        (whole,) = split_segments(alone)
        motor = identify([rest])
        model, step = motor.model, replace(whole, sensor_window_s=motor.sensor_window_s)
        percents = {
            delay_s: fit_percent(
                step.speed_rad_s, step.speed_rad_s - predict(step, replace(model, delay_s=delay_s))
            )
            for delay_s in (model.delay_s, *np.arange(0.03, 0.13, 0.001).tolist())
        }
        own_s = max(percents, key=lambda delay_s: percents[delay_s])
        window = f"{1e3 * motor.sensor_window_s:.0f} +- {1e3 * motor.uncertainty.sensor_window_s:.0f} ms"
        figure(f"filtered speeds, step {held_out - 1} from the other, window {window}",
               f"{percents[model.delay_s]:.1f}", "%", aim=">= 88")  # fmt: skip
        figure(f"  with its own delay, {1e3 * own_s:.0f} ms instead of {1e3 * model.delay_s:.0f} ms",
               f"{percents[own_s]:.1f}", "%")  # fmt: skip


def rules() -> None:
    """Print every rule on the nominal wheel at 10 Hz, PI alone."""
    model = MotorModel(gain=0.0584, time_constant_s=0.075, friction_forward=19.3, friction_backward=19.3)
    print("rules, 10 Hz, tau 75 ms: kp, ki, Ms, worst Ms, settling [s], overshoot [%], ITAE of a step [s^2]")
    for rule in RULE_NAMES:
        result = design(model, EXACT, DesignOptions(rule=rule))
        gains, step = result.gains, result.step_info
        print(
            f"  {rule:16} {gains.kp:5.1f} {gains.ki:5.1f} {result.margins.max_sensitivity:5.2f} "
            f"{result.worst_case.max_sensitivity:5.2f} {step.settling_time_s:4.1f} "
            f"{step.overshoot_percent:4.0f} {step.itae:.3f}"
        )


def tracking() -> None:
    """Drive the trapezoid with the real firmware in simulation, with one set of gains on 27 robots."""
    whole = RobotParams.load()
    usual = whole.battery.state_of_charge
    gains: Design | None = None
    worst: dict[float, tuple[float, float]] = {}
    conditions = itertools.product((usual, EMPTY, 1.0), (1.0, 0.36, 2.0), (1.0, 0.5, 2.0))
    for charge, inertia, friction in conditions:
        with _robot(whole, charge, inertia, friction) as board:
            if gains is None:
                gains = _designed_on(board)
            result = _verified(board, gains.gains, hold_s=8.0)
        _show(f"{_open_circuit_V(whole, charge):.1f} V inertia x{inertia} friction x{friction}", result)
        for t in result.tracking:
            std, mean = worst.get(t.acceleration_rad_s2, (0.0, 0.0))
            worst[t.acceleration_rad_s2] = (max(std, t.std_rad_s), max(mean, abs(t.mean_rad_s)))
    for ramp, (std, mean) in worst.items():
        print(f"  worst of 27 at {ramp:g} rad/s^2: std {std:.3f}, |mean| {mean:.3f} rad/s")
        figure(f"wheel speed error on 27 robots at {ramp:g} rad/s^2, worst: mean / std",
               f"{mean:.3f} / {std:.3f}", "rad/s", aim="<= 0.04 / <= 0.30",
               peers="-0.04 / 0.31", source="thesis, experiment 8.2")  # fmt: skip


def pairs() -> None:
    """Print how the default kp, ki and two other pairs track on loaded robots, with one feed-forward.

    Five robots per preset. Each is tuned, then driven with twice the friction, other inertia and charge.
    """
    whole = RobotParams.load()
    usual = whole.battery.state_of_charge
    loads = tuple(itertools.product((usual, EMPTY, 1.0), (0.36, 2.0), (2.0,)))
    default = PiGains(kp=PARAMETER_SPECS["kp"].default, ki=PARAMETER_SPECS["ki"].default)
    print("preset, kp, ki: worst Ms, worst Ms of the plant family, longest settling of PI alone [s]; "
          "std at 4 and 8 rad/s^2, mean and worst robot; largest mean at each")  # fmt: skip
    for preset in PRESETS:
        models = []
        for seed in PAIR_SEEDS:
            with _robot(whole, usual, 1.0, 1.0, preset, seed) as board:
                models.append(_designed_on(board))
        for pair in (default, *OTHER_PAIRS):
            designs = [design(one.model, one.uncertainty, DesignOptions(manual=pair)) for one in models]
            errors = []
            for (seed, tuned), load in itertools.product(zip(PAIR_SEEDS, designs, strict=True), loads):
                with _robot(whole, *load, preset, seed) as board:
                    result = _verified(board, tuned.gains, hold_s=3.0)
                errors.append([(abs(t.mean_rad_s), t.std_rad_s) for t in result.tracking])
            means, stds = np.moveaxis(np.array(errors), 2, 0)
            print(f"  {preset:8} {pair.kp:5.1f} {pair.ki:5.1f} "
                  f"{max(d.margins.max_sensitivity for d in designs):6.2f} "
                  f"{max(d.worst_case.max_sensitivity for d in designs):5.2f} "
                  f"{max(d.step_info.settling_time_s for d in designs):5.1f}   "
                  f"{_two(stds.mean(axis=0))}  {_two(stds.max(axis=0))}  {_two(means.max(axis=0))}",
                  flush=True)  # fmt: skip


def _two(values: FloatArray) -> str:
    return ", ".join(f"{value:.3f}" for value in values)


@contextmanager
def _robot(
    whole: RobotParams, charge: float, inertia: float, friction: float, preset: str = "nominal", seed: int = 1
) -> Iterator[Board]:
    """Open a simulated robot; it arms only above 7.0 V, so a lower charge is set once it has seen that."""
    name = f"{preset}{seed}_v{charge:.3f}_{inertia}_{friction}"
    armable = max(charge, whole.battery.state_of_charge)
    url = f"sim://{name}/board?world=hall&x_m=-4&charge={armable}&preset={preset}&seed={seed}"
    with patch.object(RobotParams, "load", return_value=_varied(whole, inertia, friction)):
        board = Board.open(url, baud=500_000)
    try:
        board.poll(3.0)
        simulation(name).fault("battery.charge", charge)
        yield board
    finally:
        board.close()


def _verified(board: Board, gains: BoardGains, hold_s: float) -> Verification:
    with TemporaryDirectory() as folder:  # a log is moved into place: never to /dev/null
        return verify(board, gains, VerifyOptions(hold_s=hold_s), Path(folder) / "log.csv", _silent)


def _designed_on(board: Board) -> Design:
    with TemporaryDirectory() as folder:
        logs = read_logs(record(board, ExcitationOptions(), Path(folder) / "run.csv", _silent))
    return design(*nominal_model([identify([log]) for log in logs]), DesignOptions())


def _open_circuit_V(whole: RobotParams, charge: float) -> float:
    volts = whole.battery.open_circuit_V
    return float(np.interp(charge, np.linspace(0.0, 1.0, len(volts)), volts))


def _varied(whole: RobotParams, inertia: float, friction: float) -> RobotParams:
    return replace(
        whole,
        motor=replace(
            whole.motor,
            inertia_kg_m2=whole.motor.inertia_kg_m2 * inertia,
            coulomb_Nm=whole.motor.coulomb_Nm * friction,
        ),
        body=replace(
            whole.body,
            mass_kg=whole.body.mass_kg * inertia,
            yaw_inertia_kg_m2=whole.body.yaw_inertia_kg_m2 * inertia,
        ),
    )


def _show(name: str, result: Verification) -> None:
    texts = [f"{t.acceleration_rad_s2:g}: {t.mean_rad_s:+.3f} {t.std_rad_s:.3f}" for t in result.tracking]
    print(f"  {name}: mean, std at {'; '.join(texts)}", flush=True)


def _silent(done: int, total: int, activity: str) -> None:
    pass


def main() -> None:
    """Run the named parts, or all."""
    parts = {
        "simulated": simulated,
        "recorded": recorded,
        "rules": rules,
        "tracking": tracking,
        "pairs": pairs,
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", nargs="*", help=f"what to run, of {', '.join(parts)}; all if none is named")
    names = parser.parse_args().part or list(parts)
    if unknown := set(names) - set(parts):
        parser.error(f"unknown part {min(unknown)!r}; choose from {', '.join(parts)}")
    for name in names:
        parts[name]()


if __name__ == "__main__":
    main()
