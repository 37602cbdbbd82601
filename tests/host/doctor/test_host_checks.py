"""Checks of the udev rules and the user unit, and of the files that the project ships."""

import getpass
from pathlib import Path

import pytest

from thumper.doctor.check import Check
from thumper.doctor.host_checks import RULES, UNIT, check_set_up
from thumper.doctor.usb_ports import KNOWN_USB

PACKAGING = Path(__file__).parents[3] / "packaging"


def checks(root: Path) -> list[Check]:
    return list(check_set_up(KNOWN_USB, root=root, home=root / "home", platform="linux"))


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    path = tmp_path / "etc/udev/rules.d" / RULES
    path.parent.mkdir(parents=True)
    path.write_bytes((PACKAGING / RULES).read_bytes())
    return path


@pytest.fixture
def unit(tmp_path: Path) -> Path:
    path = tmp_path / "home" / UNIT
    path.parent.mkdir(parents=True)
    path.write_bytes((PACKAGING / "thumper.service").read_bytes())
    return path


def test_the_shipped_rules_cover_every_known_port(tmp_path: Path, rules: Path) -> None:
    assert checks(tmp_path)[0] == Check(verdict="pass", what=f"udev rules {rules}")


def test_without_rules_the_check_says_how_to_install_them(tmp_path: Path) -> None:
    rule, unit = checks(tmp_path)
    assert rule.verdict == "warn"
    assert rule.fix.startswith(f"sudo cp {PACKAGING / RULES} ")
    assert unit.verdict == "info"  # start at boot is optional


def test_missing_rules_are_named(tmp_path: Path, rules: Path) -> None:
    lines = rules.read_text().splitlines(keepends=True)
    rules.write_text("".join(f"# {line}" if "10c4" in line else line for line in lines))
    assert checks(tmp_path)[0].what == "udev rules lack 10c4:ea60"


def test_rules_grant_access_to_the_group_only() -> None:
    lines = [line for line in (PACKAGING / RULES).read_text().splitlines() if line.startswith("ATTRS")]
    assert len(lines) == 5
    for line in lines:
        for part in ('GROUP="dialout"', 'MODE="0660"', 'ENV{ID_MM_DEVICE_IGNORE}="1"', 'SYMLINK+="thumper-'):
            assert part in line


def test_a_unit_whose_program_is_missing_fails(tmp_path: Path, unit: Path) -> None:
    assert checks(tmp_path)[1].verdict == "fail"
    assert str(tmp_path / "home/.local/bin/thumper") in checks(tmp_path)[1].what


def test_a_unit_needs_lingering_to_start_at_boot(tmp_path: Path, unit: Path) -> None:
    program = tmp_path / "home/.local/bin/thumper"
    program.parent.mkdir(parents=True)
    program.touch()
    assert "enable-linger" in checks(tmp_path)[1].fix
    linger = tmp_path / "var/lib/systemd/linger" / getpass.getuser()
    linger.parent.mkdir(parents=True)
    linger.touch()
    assert checks(tmp_path)[1] == Check(verdict="pass", what=f"user unit {unit}")


def test_other_systems_have_neither() -> None:
    assert list(check_set_up(KNOWN_USB, platform="darwin")) == []
