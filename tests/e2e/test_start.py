"""What the commands load when they start, and what a shell completes."""

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

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
    code = (
        "import sys; sys.argv = ['thumper', 'run', '--help']\n"
        "from thumper.cli.app import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "slow = {'numpy', 'numba', 'scipy', 'matplotlib', 'serial', 'rosbags', 'thumper.ros.services'}\n"
        "print(slow & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_what_runs_no_kernel_loads_no_compiler() -> None:
    """The page beside each robot, and wrong input that a command refuses before it drives."""
    code = (
        "import sys, thumper.dashboard.server, thumper.cli.robot_run\n"
        "print({'numba', 'llvmlite', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"


def test_a_running_robot_loads_no_library_that_it_does_not_need() -> None:
    """Scipy takes 22 MB, matplotlib 27: only pictures at the end of a drive need the latter."""
    code = (
        "import sys, thumper.cli.robot_run\n"
        "from thumper.config.robot import RobotConfig\n"
        "from thumper.runtime.assembly import warm_up\n"
        "warm_up(RobotConfig())\n"
        "slow = {'scipy.linalg', 'scipy.sparse', 'matplotlib', 'PIL', 'nicegui', 'control'}\n"
        "print(slow & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "set()"
