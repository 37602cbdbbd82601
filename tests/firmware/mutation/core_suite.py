"""The tests of firmware/core that need no chip, for run.py."""

import re
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.firmware.core import host_interface  # noqa: F401  import once for all child processes
from tests.firmware.mutation.mutants import CORE
from tests.firmware.mutation.worker import Subject

TESTS = Path(__file__).resolve().parents[1] / "core"
SUITE = {
    "test_wheel": {"parameters.hpp"},
    "test_supervisor": {"supervisor.hpp"},
    "test_monitors": {"host_interface.hpp", "beep.hpp", "config.hpp"},
    "test_ramp_battery_units": {"parameters.hpp", "battery.hpp", "beep.hpp"},
    "test_host_interface": {"host_interface.hpp"},
    "test_store": {"host_interface.hpp"},
    "test_inputs": {"host_interface.hpp"},
    "test_robot_parameters": {"host_interface.hpp"},
    "test_quadrature": {"quadrature.hpp", "drive.hpp"},
    "test_framing": {"framing.hpp"},
    "test_model": {"parameters.hpp"},
    "test_law": {"parameters.hpp"},
    "test_pi": {"pi.hpp"},
    "test_gyro_heading": {"gyro_heading.hpp"},
    "test_acceleration": {"host_interface.hpp"},
}
"""The headers that a test exercises. Together with their includes, it can detect a change in these only. The
quick tests come first, because pytest stops at the first failure."""
OWN = {
    "acceleration.hpp": "test_acceleration",
    "battery.hpp": "test_ramp_battery_units",
    "beep.hpp": "test_ramp_battery_units",
    "config.hpp": "test_law",
    "crc.hpp": "test_framing",
    "drive.hpp": "test_quadrature",
    "feedforward.hpp": "test_model",
    "fixed.hpp": "test_law",
    "flash.hpp": "test_host_interface",
    "framing.hpp": "test_framing",
    "gyro_heading.hpp": "test_gyro_heading",
    "host_interface.hpp": "test_host_interface",
    "monitor.hpp": "test_monitors",
    "parameters.hpp": "test_store",
    "pi.hpp": "test_pi",
    "quadrature.hpp": "test_quadrature",
    "ramp.hpp": "test_ramp_battery_units",
    "store.hpp": "test_store",
    "supervisor.hpp": "test_supervisor",
    "units.hpp": "test_ramp_battery_units",
    "wheel.hpp": "test_wheel",
}
"""The test most likely to detect a change in a file; it runs first."""
INCLUDE = re.compile(r'#include "core/(.+)"')
LONG = re.compile("million|long_drive")
"""Tests that take seconds."""
MIN_SHARE = 0.99
"""Of all mutants that are not listed as equivalent."""

# Which example fails does not matter here, so skip shrinking. A busy machine is no failure.
settings.register_profile(
    "mutation",
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=list(HealthCheck),
)


@cache
def reached(header: str) -> frozenset[str]:
    """Return a header of the core and everything it includes."""
    included = INCLUDE.findall((CORE / header).read_text(encoding="utf-8"))
    return frozenset({header}).union(*map(reached, included))


def suite_for(items: list[pytest.Item], file: str) -> list[pytest.Item]:
    """Return the tests that can detect a change in a file: the most likely first, the long ones last."""
    able = [name for name, roots in SUITE.items() if any(file in reached(root) for root in roots)]
    able.sort(key=lambda name: name != OWN.get(file))
    chosen = [item for item in items if item.path.stem in able]
    return sorted(chosen, key=lambda item: (bool(LONG.search(item.name)), able.index(item.path.stem)))


CORE_SUBJECT = Subject(
    within="core",
    modules=[TESTS / f"{name}.py" for name in SUITE],
    options=["--hypothesis-profile=mutation", "-p", "_hypothesis_pytestplugin"],
    suite=suite_for,
    prepare=lambda _: "",
    timeout_s=10,  # the longest takes 1.2 s
)
