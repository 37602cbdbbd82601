"""`thumper tune` at a robot that is at service: the same experiment, fit and design, asked for by bus."""

from dataclasses import replace
from pathlib import Path

from thumper.runtime.service.experiments import ExperimentContext
from thumper_tuning.cli.fit import runs_of
from thumper_tuning.design.gains import Design, DesignOptions, design, nominal
from thumper_tuning.drive.board_gains import read_gains, write_gains
from thumper_tuning.drive.excitation import ExcitationOptions
from thumper_tuning.drive.record import record
from thumper_tuning.drive.verify import Verification, VerifyOptions, verify
from thumper_tuning.identify.motor import Identified, identify
from thumper_tuning.report.page import write_report

LONGEST_HOLD_S = 1.5


def identify_motors(bench: ExperimentContext) -> Path | None:
    """Drive the identification experiment and tell what the motors are."""
    _identified(bench)
    return None


def tune_wheels(bench: ExperimentContext) -> Path | None:
    """Identify, design, drive with the old and the new gains; the new ones stay on, but are not saved.

    When it is cut short the old gains are on again.
    """
    board = bench.board
    old = read_gains(board)
    kept = False
    try:
        motors = _identified(bench)
        result = bench.run_in_thread(lambda: _designed(motors, 1.0 / board.identity.control_rate_Hz))
        for name, value in result.gains.items():
            bench.report_line(f"{name} {getattr(old, name):.3f} -> {value:.3f}")
        bench.report_line(
            f"Ms {result.loop.sensitivity:.2f}, phase margin {result.loop.phase_margin_deg:.0f} deg"
        )
        options = _verification(bench)
        before = verify(board, old, options, bench.folder / "verify_before.csv", bench.report_progress)
        after = verify(board, result.gains, options, bench.folder / "verify_after.csv", bench.report_progress)
        for was, now in zip(before.tracking, after.tracking, strict=True):
            bench.report_line(
                f"ramp {now.acceleration_rad_s2:g} rad/s^2: error std {was.std_rad_s:.3f} -> "
                f"{now.std_rad_s:.3f} rad/s"
            )
        report = bench.run_in_thread(lambda: _report(bench, motors, result, before, after))
        kept = True
        bench.report_line(
            "the board works with the new gains; save them, or revert to the saved ones, under Gains"
        )
        return Path(report)
    finally:
        if not kept:
            write_gains(board, old)


def _identified(bench: ExperimentContext) -> list[Identified]:
    options = ExcitationOptions(lane_m=bench.lane_m)
    log = record(bench.board, options, bench.folder / "identification.csv", bench.report_progress)
    bench.report_progress(0, 0, "fitting")
    counts_per_rev = bench.board.identity.counts_per_rev
    motors: list[Identified] = bench.run_in_thread(
        lambda: [identify(logs, one_direction=False) for logs in runs_of([log], counts_per_rev)]
    )
    for motor in motors:
        model, std = motor.model, motor.uncertainty
        bench.report_line(
            f"{motor.name}: gain {model.gain:.5f} +- {std.gain:.5f} rad/s per PWM, time constant "
            f"{model.time_constant_s:.4f} +- {std.time_constant_s:.4f} s, static friction "
            f"{model.friction:.1f} +- {std.friction:.1f} PWM; predicts {motor.validation.fit_percent:.1f} %"
        )
        for warning in motor.warnings:
            bench.report_line(f"note: {warning}")
    return motors


def _designed(motors: list[Identified], period_s: float) -> Design:
    model, std = nominal(motors, None)
    return design(model, std, replace(DesignOptions(), period_s=period_s))


def _verification(bench: ExperimentContext) -> VerifyOptions:
    """Trapezoids that fit the lane: from its middle there is no more room than it has."""
    radius_m = bench.board.identity.wheel_radius_mm / 1000.0
    options = VerifyOptions(hold_s=LONGEST_HOLD_S)
    for speed_rad_s in (8.0, 6.0, 5.0, 4.0, 3.0):
        for hold_s in (LONGEST_HOLD_S, 0.5):
            options = VerifyOptions(speed_rad_s=speed_rad_s, hold_s=hold_s)
            if options.lane_m(radius_m) <= bench.lane_m:
                return options
    return options


def _report(
    bench: ExperimentContext,
    motors: list[Identified],
    result: Design,
    before: Verification,
    after: Verification,
) -> Path:
    return write_report(bench.folder / "report.html", motors, result, before.gains, before, after)
