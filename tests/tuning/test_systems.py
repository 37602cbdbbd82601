"""The identified motor as python-control systems, the models compared, and their export."""

import runpy
from pathlib import Path

import control
import numpy as np
import pytest
from benchmarks.shared.wheel_plant import Wheel, steps_and_prbs

from tests.tuning.test_fit import make_log
from thumper.common.geometry import FloatArray
from thumper_tuning.design.gains import DesignOptions, design, nominal_model
from thumper_tuning.identify import compare_models
from thumper_tuning.identify.model import MotorModel
from thumper_tuning.identify.motor import IdentifiedMotor, identify
from thumper_tuning.identify.motor_response import DriveSignal, motor_parameters, simulate
from thumper_tuning.identify.realization import impulse_response, linear_record
from thumper_tuning.identify.richer_models import fit_richer_models
from thumper_tuning.identify.systems import (
    continuous_system,
    counted_second_order_system,
    counted_system,
    friction_system,
    second_order_system,
)
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.report.export import write_models

PERIOD_S = 0.1
TIME_S = np.arange(31, dtype=float) * PERIOD_S


@pytest.fixture(scope="module")
def motor() -> IdentifiedMotor:
    return identify([make_log(Wheel(), 0)])


def _model(delay_s: float, friction: float = 0.0) -> MotorModel:
    return MotorModel(
        gain=0.06,
        time_constant_s=0.08,
        friction_forward=friction,
        friction_backward=friction,
        delay_s=delay_s,
        breakaway_ratio=1.3,
    )


def test_without_delay_the_counted_system_is_that_of_sample_system() -> None:
    """The counted speed is the difference of the zero-order-hold angle: `control.sample_system` of G / s."""
    model = _model(0.0)
    angle = control.sample_system(
        control.series(continuous_system(model), control.tf([1], [1, 0])), PERIOD_S, "zoh"
    )
    difference = control.tf([1.0, -1.0], [PERIOD_S, 0.0], PERIOD_S)
    expected = control.step_response(control.series(angle, difference), TIME_S)
    found = control.step_response(counted_system(model, PERIOD_S), TIME_S)
    assert found.outputs == pytest.approx(expected.outputs, abs=1e-9)


@pytest.mark.parametrize("delay_s", [0.0, 0.04, 0.23])
@pytest.mark.parametrize("friction", [0.0, 19.0])
def test_the_system_with_friction_is_the_simulation(delay_s: float, friction: float) -> None:
    model = _model(delay_s, friction)
    drive = np.random.default_rng(0).uniform(-200.0, 200.0, 31)
    drive[10:14] = 15.0
    signal = DriveSignal(TIME_S, drive, 0.0)
    angles, _ = simulate(signal, TIME_S, 0.0, motor_parameters(model))
    response = control.input_output_response(friction_system(model, PERIOD_S), TIME_S, drive)
    assert np.ravel(response.outputs)[1:] == pytest.approx(np.diff(angles) / PERIOD_S, abs=1e-9)
    if friction == 0.0:
        linear = control.forced_response(counted_system(model, PERIOD_S), TIME_S, drive)
        assert np.ravel(linear.outputs) == pytest.approx(np.ravel(response.outputs), abs=1e-9)


@pytest.mark.parametrize(("second_s", "delay_s"), [(0.02, 0.0), (0.08, 0.0), (0.03, 0.13)])
def test_the_counted_second_order_system_is_the_continuous_one(second_s: float, delay_s: float) -> None:
    """Mean speeds over the period, integrated in fine steps of the continuous response."""
    model, fine_s = _model(delay_s), np.arange(0.0, 3.0, 0.001)
    lag = control.series(continuous_system(_model(0.0)), control.tf([1.0], [second_s, 1.0]))
    assert control.dcgain(second_order_system(model, second_s)) == pytest.approx(model.gain)
    _, speed = control.step_response(lag, fine_s)
    delayed = np.interp(fine_s - delay_s, fine_s, speed, left=0.0)
    means = [delayed[k * 100 : k * 100 + 101].mean() for k in range(29)]
    counted = control.step_response(counted_second_order_system(model, second_s, PERIOD_S), TIME_S)
    assert np.ravel(counted.outputs)[1:30] == pytest.approx(means, abs=2e-4)


def test_the_impulse_response_needs_no_record_without_gaps(motor: IdentifiedMotor) -> None:
    """Half of the windows are withheld, in tenths: the Markov parameters stay those of the motor."""
    segments = list(motor.segments)
    record = linear_record(segments, motor.model)
    assert record is not None
    count = int(record.window.sum())
    use = (np.arange(count) // 40) % 2 == 0
    exact = control.impulse_response(motor.counted(PERIOD_S), TIME_S[:6], squeeze=True)
    # Within a window the drive already acts: the first parameter is that of the same window.
    expected = np.asarray(exact.outputs)[1:6] * PERIOD_S
    for kept in (None, use):
        assert impulse_response(record, kept)[:5] == pytest.approx(expected, abs=0.08 * motor.model.gain)


def test_models_are_compared_by_validation_fit(motor: IdentifiedMotor) -> None:
    own, second, *era = motor.compare()
    assert own.fit_percent is not None
    assert second.fit_percent is not None
    assert second.kind == "second order"
    assert second.fit_percent > own.fit_percent - 0.5
    assert own.fit_percent == motor.validation.fit_percent
    assert [model.kind for model in era] == ["ERA, order 1", "ERA, order 2"]
    for model in era:
        assert model.fit_percent is not None
        assert 90.0 < model.fit_percent < own.fit_percent
        assert control.dcgain(model.system) == pytest.approx(Wheel().gain, rel=0.02)
    assert era[0].time_constant_s == pytest.approx(Wheel().tau_s, rel=0.05)


@pytest.mark.parametrize("stable_models", [0, 1], ids=["of the whole log", "of a part of the log"])
def test_an_unstable_model_is_called_unstable(
    motor: IdentifiedMotor, monkeypatch: pytest.MonkeyPatch, stable_models: int
) -> None:
    orders: list[int] = []

    def realize(_response: FloatArray, order: int, period_s: float) -> control.LTI:
        orders.append(order)
        pole = 0.5 if orders.count(order) <= stable_models else 1.001
        return control.ss([[pole]], [[1.0]], [[1.0]], [[0.0]], period_s)

    monkeypatch.setattr(compare_models, "realize", realize)
    assert [model.fit_percent for model in motor.compare()[-2:]] == [None, None]


def test_the_export_loads_into_python_control(motor: IdentifiedMotor, tmp_path: Path) -> None:
    result = design(*nominal_model([motor]), DesignOptions())
    write_models(tmp_path, [motor], result)
    loader = tmp_path / "load_models.py"
    assert len(loader.read_text().splitlines()) == 5
    systems = runpy.run_path(str(loader))["systems"]
    second = motor.second_order()
    for name, expected in (
        ("wheel_counted", motor.counted(PERIOD_S)),
        (
            "wheel_second_order",
            counted_second_order_system(second.base, second.second_time_constant_s, PERIOD_S),
        ),
        ("wheel_era_2", motor.compare()[3].system),
        ("closed_loop", result.loop.closed_loop),
    ):
        found = control.step_response(systems[name], TIME_S)
        assert found.outputs == pytest.approx(control.step_response(expected, TIME_S).outputs, abs=1e-8)
    assert systems["wheel_continuous"].isctime()


@pytest.mark.slow
def test_a_richer_model_predicts_as_well_as_the_first_order() -> None:
    """Also speeds that a driver reads at the row, not averaged over it: there the second order was worse."""
    period_s = 0.02
    time_s = period_s * np.arange(1250.0)
    pwm = np.repeat(steps_and_prbs(250, 3), 5)
    angle = Wheel().drive(time_s, pwm, 3)
    speed = np.gradient(angle, period_s)
    log = MotorLog(
        name="wheel",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=pwm,
        starts_segment=np.arange(len(time_s)) == 0,
        speed_rad_s=speed,
        quantum_rad=0.0,
    )
    found = identify([log])
    (second,) = fit_richer_models(list(found.segments), found.fit, backlash=False)
    assert second.fit_percent > found.validation.fit_percent - 0.5


@pytest.mark.parametrize("delay_s", [0.0, 1e-15, 1e-6, 0.002, 0.05])
@pytest.mark.parametrize("second_s", [1e-22, 1e-5, 0.02])
def test_every_exported_system_has_a_step_response(delay_s: float, second_s: float) -> None:
    model = _model(delay_s)
    for system in (
        continuous_system(model),
        counted_system(model, PERIOD_S),
        second_order_system(model, second_s),
        counted_second_order_system(model, second_s, PERIOD_S),
    ):
        end = control.step_response(system, np.arange(0.0, 3.0, PERIOD_S)).outputs[-1]
        assert end == pytest.approx(model.gain, rel=0.01)
