"""The options of `thumper tune` from a file: priority and errors."""

from pathlib import Path

import pytest

from thumper.common.errors import ThumperError
from thumper_tuning.cli.settings import TuneOptions, load_settings
from thumper_tuning.design.tuning_rules import PiGains


def _file(folder: Path, text: str) -> Path:
    path = folder / "tune.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_without_a_file_the_defaults_apply() -> None:
    assert load_settings(None) == TuneOptions()


def test_the_command_line_overrides_the_file_and_the_file_the_defaults(tmp_path: Path) -> None:
    path = _file(
        tmp_path,
        "[excitation]\nlane_m = 2.0\nsteps_pwm = [50, 90]\n[verify]\nspeed_rad_s = 5\nhold_s = 1.0\n"
        "[design]\nrule = 'simc'\nfeed_forward = false\n",
    )
    settings = load_settings(path).override(hold_s=3.0)
    assert (settings.excitation.lane_m, settings.excitation.steps_pwm) == (2.0, (50, 90))
    assert settings.excitation.high_pwm == 160
    assert (settings.verify.speed_rad_s, settings.verify.hold_s) == (5.0, 3.0)
    assert (settings.design.rule, settings.design.feed_forward) == ("simc", False)
    assert settings.override(rule="amigo").design.rule == "amigo"


def test_a_rule_on_the_command_line_overrides_gains_in_the_file(tmp_path: Path) -> None:
    settings = load_settings(_file(tmp_path, "[design.manual]\nkp = 3.0\nki = 2.0\n"))
    assert settings.design.manual == PiGains(kp=3.0, ki=2.0)
    assert settings.override(rule="migo").design.manual is None


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[excitation]\nlane = 1.2", "excitation.lane; did you mean 'lane_m'"),
        ("[excitment]\nlane_m = 1.2", "excitment"),
        ("[excitation]\nlane_m = 0.1", "excitation.lane_m = 0.1"),
        ("[excitation]\nlane_m = inf", "excitation.lane_m"),
        ("[excitation]\nsteps_pwm = []", "excitation.steps_pwm"),
        ("[excitation]\nsteps_pwm = [300]", "excitation.steps_pwm.0 = 300"),
        ("[excitation]\nlow_pwm = 200", "excitation.low_pwm = 200"),
        ("[excitation]\nlow_pwm = '70'", "excitation.low_pwm"),
        ("[verify]\naccelerations_rad_s2 = [4, 0]", "verify.accelerations_rad_s2.1"),
        ("[design]\nrule = 'magic'", "design.rule = 'magic'"),
        ("[design]\nlargest_sensitivity = 1.0", "design.largest_sensitivity"),
        ("[design]\nperiod_s = 0.02", "design.period_s"),
        ("[design.manual]\nkp = 3.0", "design.manual.ki"),
        ("excitation = 3", "excitation"),
        ("[excitation", "not valid TOML"),
    ],
)
def test_an_error_names_the_file_and_the_key(tmp_path: Path, text: str, named: str) -> None:
    path = _file(tmp_path, text)
    with pytest.raises(ThumperError) as rejected:
        load_settings(path)
    assert str(path) in str(rejected.value)
    assert named in str(rejected.value)
    assert rejected.value.exit_code == 2


def test_a_missing_file_and_an_unknown_rule_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match="cannot read the settings"):
        load_settings(tmp_path / "none.toml")
    with pytest.raises(ThumperError, match=r"--rule = 'magic': unknown rule; choose from: migo"):
        TuneOptions().override(rule="magic")
    with pytest.raises(ThumperError, match=r"--rule = 'migos': unknown rule; did you mean 'migo'\?"):
        TuneOptions().override(rule="migos")
