"""Compare the simulated robot with the robot of the thesis: `python benchmarks/sim_validation.py`.

Experiment 1 of the thesis (Švec 2019, 8.1): drive manually and compare the wheel speeds from the encoders
with those from the observed motion of the body, `w = (v -+ yaw rate * l / 2) / r`, l = 0.245 m.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
from matplotlib.figure import Figure

from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, SetMotorPwm, SetWheelSpeeds
from thumper.common.geometry import FloatArray
from thumper_hil.bench.bench import DEFAULT_ELF, Bench
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.chip import CPU_HZ, Chip
from thumper_hil.chip.robot_params import RobotParams

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

RADIUS_M, GEOMETRIC_TRACK_M = 0.062, 0.245
THESIS = {"left": "+0.80 / 0.88", "right": "-0.43 / 0.65"}
SEEDS = range(1, 6)
STOPS_FROM_M_S = (0.3, 0.5)
OCR2A, OCR2B = 0xB3, 0xB4  # duty of the right and the left motor
SMOOTHING = 10  # of 100 Hz samples: the thesis low-pass filtered its speeds
MANUAL_SPEEDS = (
    (5.0, 1.0),
    (8.0, 8.0),
    (7.0, -5.0),
    (7.0, 0.5),
    (1.0, 7.0),
    (8.0, 8.0),
    (7.0, -5.0),
    (4.0, 4.0),
)
"""Wheel speeds [rad/s], left and right, for 1.3 s each: circles, mostly to the right."""


def manual_drive(seed: int) -> tuple[FloatArray, FloatArray]:
    """Return wheel speeds [rad/s] from encoders and from the motion, shape (n, 2) each, at 100 Hz."""
    bench = _armed(seed)
    for _ in range(2):
        for left, right in MANUAL_SPEEDS:
            for _ in range(13):
                command = SetWheelSpeeds(left=round(1000 * left), right=round(1000 * right))
                bench.chip.send(encode_frame(command.ID, 1, command.pack()))
                bench.advance(bench.time_s + 0.1)
    assert bench.contacts == 0
    truth = bench.truth()
    heading = np.unwrap(truth[:, 3])
    along = np.cos(heading) * np.gradient(truth[:, 1], 0.01) + np.sin(heading) * np.gradient(
        truth[:, 2], 0.01
    )
    half_turn = 0.5 * GEOMETRIC_TRACK_M * np.gradient(heading, 0.01)
    observed = np.column_stack([along - half_turn, along + half_turn]) / RADIUS_M
    return _smooth(truth[:, 4:6]), _smooth(observed)


def step_response(seed: int) -> FloatArray:
    """Apply PWM 160 open loop from standstill in an empty hall; return rows time [s], left, right [rad/s]."""
    bench = _armed(seed)
    start_s = bench.time_s
    for _ in range(10):
        command = SetMotorPwm(left=160, right=160)
        bench.chip.send(encode_frame(command.ID, 1, command.pack()))
        bench.advance(bench.time_s + 0.1)
    truth = bench.truth()
    return truth[truth[:, 0] >= start_s][:, [0, 4, 5]] - (start_s, 0.0, 0.0)


def emergency_stop(pwm_low: Literal["coast", "brake"], v_m_s: float) -> FloatArray:
    """Stop from a straight drive; return rows time since PWM 0 [s], speed [m/s], distance since then [m]."""
    params = RobotParams.load()
    params = replace(params, board=replace(params.board, pwm_low=pwm_low))
    chip = Chip(DEFAULT_ELF, params=params, seed=1)

    def run_for(seconds: float) -> None:
        chip.run(chip.cycle + round(seconds * CPU_HZ))

    run_for(0.1)
    _command(chip, Command.ARM)
    speed = round(1000.0 * v_m_s / RADIUS_M)
    for _ in range(20):
        chip.send(encode_frame(SetWheelSpeeds.ID, 1, SetWheelSpeeds(left=speed, right=speed).pack()))
        run_for(0.1)
    _command(chip, Command.E_STOP)
    while chip.data(OCR2A) or chip.data(OCR2B):
        run_for(0.001)
    start, rows = chip.truth(), list[tuple[float, float, float]]()
    while not rows or rows[-1][1] > 0.0:
        truth = chip.truth()
        distance_m = truth.map_from_base.distance_m(start.map_from_base)
        rows.append((truth.time_s - start.time_s, RADIUS_M * max(truth.wheel_rad_s), distance_m))
        run_for(0.001)
    return np.array(rows)


def _command(chip: Chip, command: Command) -> None:
    chip.send(encode_frame(CommandRequest.ID, 1, CommandRequest(command=command).pack()))


def _armed(seed: int) -> Bench:
    bench = Bench(BenchOptions(world="hall", x_m=-3.0, seed=seed))
    bench.advance(0.1)
    _command(bench.chip, Command.ARM)
    return bench


def _smooth(speeds: FloatArray) -> FloatArray:
    window = np.ones(SMOOTHING) / SMOOTHING
    return np.column_stack([np.convolve(column, window, "valid") for column in speeds.T])


def main() -> None:
    """Print the figures and write the plots."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for the plots")
    out: Path = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)

    print("wheel speed from the encoders minus speed from the observed motion [rad/s], mean / std:")
    both = []
    for seed in SEEDS:
        wheels, observed = manual_drive(seed)
        error = wheels - observed
        both.append([f"{error[:, side].mean():+.2f} / {error[:, side].std():.2f}" for side, _ in SIDES])
        cells = [f"{name} {cell}" for cell, (_, name) in zip(both[-1], SIDES, strict=True)]
        print(f"  robot {seed}: {', '.join(cells)}")
        if seed == SEEDS[0]:
            _plot_speeds(out / "sim_odometry.png", wheels, observed)
    what = "simulated robot 1, manual drive: wheel speed from encoders minus from motion,"
    for side, name in SIDES:
        figure(f"{what} {name}, mean / std", both[0][side], "rad/s", peers=f"real {THESIS[name]}",
               source="thesis, experiment 8.1")  # fmt: skip
    picture = Figure(figsize=(8, 4), layout="constrained")
    axes = picture.subplots()
    for seed in SEEDS:
        time_s, left, _ = step_response(seed).T
        axes.plot(time_s, left, lw=1, label=f"robot {seed}")
    axes.set(xlabel="time [s]", ylabel="left wheel [rad/s]", title="PWM 160 from standstill, five robots")
    axes.legend(frameon=False)
    picture.savefig(out / "sim_step.png", dpi=120)
    _show_stops(out / "sim_stop.png")
    print(f"wrote sim_odometry.png, sim_step.png and sim_stop.png to {out}/")


SIDES = ((0, "left"), (1, "right"))


def _show_stops(path: Path) -> None:
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.subplots()
    print("emergency stop, from PWM 0 on:")
    for pwm_low in ("coast", "brake"):
        for v_m_s in STOPS_FROM_M_S:
            time_s, speed_m_s, distance_m = emergency_stop(pwm_low, v_m_s).T
            print(f"  {pwm_low}, from {v_m_s} m/s: {time_s[-1]:.2f} s, {100.0 * distance_m[-1]:.1f} cm")
            axes.plot(time_s, speed_m_s, lw=1, label=f"{pwm_low}: {100.0 * distance_m[-1]:.1f} cm")
    axes.set(xlabel="time since PWM 0 [s]", ylabel="speed [m/s]", title="Bridge at PWM 0")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


def _plot_speeds(path: Path, wheels: FloatArray, observed: FloatArray) -> None:
    figure = Figure(figsize=(9, 5), layout="constrained")
    for axes, (side, name) in zip(figure.subplots(2, 1, sharex=True), SIDES, strict=True):
        time_s = 0.01 * np.arange(len(wheels))
        axes.plot(time_s, wheels[:, side], lw=1, label="encoders")
        axes.plot(time_s, observed[:, side], lw=1, label="observed motion, l = 0.245 m")
        axes.set(ylabel=f"{name} [rad/s]")
    axes.set(xlabel="time [s]")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    figure.suptitle("manual drive: because of slip, the wheels turn more than the body")
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
