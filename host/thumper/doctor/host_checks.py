"""Checks of the computer's permanent setup: fixed port names and start at boot."""

import getpass
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from thumper.doctor.check import Check

RULES = "99-thumper.rules"
IN_WHEEL = Path(__file__).parents[1] / "packaging"
IN_SOURCES = Path(__file__).resolve().parents[3] / "packaging"
RULES_FOLDERS = ("etc/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
UNIT = ".config/systemd/user/thumper.service"


def check_set_up(
    usb_ids: Iterable[tuple[int, int]],
    *,
    root: Path = Path("/"),
    home: Path | None = None,
    platform: str = sys.platform,
) -> Iterator[Check]:
    """Check the udev rules for these (vendor, product) ids, and the systemd user unit."""
    if platform != "linux":
        return
    yield _rules(usb_ids, root)
    yield _unit(home or Path.home(), root)


def _rules(usb_ids: Iterable[tuple[int, int]], root: Path) -> Check:
    source = (IN_WHEEL if IN_WHEEL.is_dir() else IN_SOURCES) / RULES
    install = f"sudo cp {source} /etc/udev/rules.d/, then unplug the devices and plug them in again"
    for folder in RULES_FOLDERS:
        path = root / folder / RULES
        if path.exists():
            text = path.read_text(encoding="utf-8", errors="replace")
            missing = [f"{vid:04x}:{pid:04x}" for vid, pid in usb_ids if not _has_rule(text, vid, pid)]
            if missing:
                what = f"udev rules lack {', '.join(missing)}"
                return Check(verdict="warn", what=what, fix=install)
            return Check(verdict="pass", what=f"udev rules {path}")
    return Check(verdict="warn", what="no udev rules: port names may change", fix=install)


def _has_rule(text: str, vid: int, pid: int) -> bool:
    match = f'ATTRS{{idVendor}}=="{vid:04x}", ATTRS{{idProduct}}=="{pid:04x}"'
    return any(match in line for line in text.splitlines() if not line.lstrip().startswith("#"))


def _unit(home: Path, root: Path) -> Check:
    path = home / UNIT
    if not path.exists():
        return Check(verdict="info", what="start at boot is not set up, which is optional (thumper.service)")
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("ExecStart="):
            program = Path(line.removeprefix("ExecStart=").split()[0].replace("%h", str(home)))
            if not program.exists():
                fix = "correct ExecStart, then: systemctl --user daemon-reload"
                return Check(verdict="fail", what=f"{path} starts {program}, which does not exist", fix=fix)
    user = getpass.getuser()
    if not (root / "var/lib/systemd/linger" / user).exists():
        fix = f"to start at boot: sudo loginctl enable-linger {user}"
        return Check(verdict="warn", what="thumper.service starts only when you log in", fix=fix)
    return Check(verdict="pass", what=f"user unit {path}")
