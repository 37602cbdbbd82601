"""What the commands load when they start, and what a shell completes."""

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from tests.loaded_modules import help_of, printed_and_loaded

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("watch po", {"pose"}),
        ("sim --world lab", {"lab", "lab_box"}),
        ("sim --world house-4", {"house-4"}),
        ("sim --lidar u", {"urg04lx"}),
        ("sim --preset h", {"hard"}),
    ],
)
def test_completion_has_names_of_the_robot(typed: str, completed: set[str]) -> None:
    words = f"thumper {typed}"
    done = subprocess.run(
        [sys.executable, "-c", "import sys; sys.argv = ['thumper']; import thumper.__main__ as m; m.main()"],
        env=os.environ
        | {
            "_THUMPER_COMPLETE": "complete_bash",
            "COMP_WORDS": words,
            "COMP_CWORD": str(words.count(" ")),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert set(done.stdout.split()) == completed, done.stderr


def test_goto_accepts_negative_coordinates(thumper: Run) -> None:
    done = thumper("goto", "-0.5", "-1", "-90", "--bus", "127.0.0.1:1")
    assert "no robot is running" in done.stderr


def test_help_loads_no_slow_library() -> None:
    """`benchmarks/cli.py` measures the time."""
    slow = ("numpy", "numba", "scipy", "matplotlib", "serial", "rosbags", "thumper.ros.services")
    assert printed_and_loaded(help_of("run"), slow)[1] == set()


def test_what_runs_no_kernel_loads_no_compiler() -> None:
    """The page beside each robot, and wrong input that a command refuses before it drives."""
    code = "import thumper.dashboard.server, thumper.cli.robot_run"
    assert printed_and_loaded(code, ("numba", "llvmlite", "matplotlib"))[1] == set()


def test_a_running_robot_loads_no_library_that_it_does_not_need() -> None:
    """Scipy takes 22 MB, matplotlib 27: only pictures at the end of a drive need the latter."""
    code = (
        "import thumper.cli.robot_run\n"
        "from thumper.config.robot import RobotConfig\n"
        "from thumper.runtime.assembly import warm_up\n"
        "warm_up(RobotConfig())\n"
    )
    slow = ("scipy.linalg", "scipy.sparse", "matplotlib", "PIL", "nicegui", "control")
    assert printed_and_loaded(code, slow)[1] == set()
