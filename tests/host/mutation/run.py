"""Mutation test of what decides who may command the robot, with what, and whether a command may be driven.

python -m tests.host.mutation.run                    all mutants (`make mutation`)
python -m tests.host.mutation.run --only login.py:80    those whose printed place starts so

Each mutant runs in a fork with the tests of its file, which need neither server nor robot. Kernels run as
Python. The command lists the survivors and fails if the tests notice less than 90 %.
"""

import argparse
import importlib
import multiprocessing
import os
import signal
import sys
import types
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.host.mutation.mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[3]
DRIVE, SERVICE = "tests/host/runtime/drive/", "tests/host/runtime/service/"
SAFETY = "tests/host/navigation/safety/"
TESTS = {
    "thumper.navigation.safety.collision_monitor": [f"{SAFETY}test_collision_monitor.py"],
    "thumper.runtime.drive.assisted_teleop": [f"{DRIVE}test_assisted_teleop.py"],
    "thumper.runtime.drive.drive_manager": [f"{DRIVE}test_drive_manager.py"],
    "thumper.dashboard.login": ["tests/dashboard/test_access.py"],
    "thumper.dashboard.rate_limit": [
        "tests/dashboard/test_page_messages.py",
        "tests/dashboard/test_access.py",
    ],
    "thumper.dashboard.page_messages": ["tests/dashboard/test_page_messages.py"],
    "thumper.dashboard.page_commands": ["tests/dashboard/test_page_commands.py"],
    "thumper.bus.request_decoder": ["tests/host/bus/test_request_decoder.py"],
    "thumper.navigation.safety.command_filter": [f"{SAFETY}test_command_filter.py"],
    "thumper.navigation.safety.velocity_smoother": [f"{SAFETY}test_velocity_smoother.py"],
    "thumper.runtime.drive.data_age": [f"{DRIVE}test_data_age.py"],
    "thumper.runtime.drive.heartbeats": [f"{SERVICE}test_request_queue.py"],
    "thumper.runtime.drive.start_gate": [f"{DRIVE}test_start_gate.py"],
    "thumper.runtime.drive.twist_mux": [f"{DRIVE}test_twist_mux.py"],
    "thumper.runtime.requests": ["tests/host/runtime/test_requests.py"],
    "thumper.runtime.safe_stop": ["tests/host/runtime/test_safe_stop.py"],
    "thumper.runtime.service.preconditions": [f"{SERVICE}test_preconditions.py"],
    "thumper.runtime.service.request_queue": [f"{SERVICE}test_request_queue.py"],
    "thumper.runtime.service.stall_guard": [f"{SERVICE}test_stall_guard.py"],
}
"""The module of each mutant, and the tests that should notice it."""
OWN_PACKAGES = ("thumper", "tests", "benchmarks")
TIMEOUT_S = 20
MIN_SHARE = 0.9


@dataclass(frozen=True, slots=True)
class Score:
    """How many mutants of one module were made, and the places of those that no test noticed."""

    made: int
    survivors: list[str]


def main() -> int:
    """Run the mutants; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="*", default=[""], help="starts of the places to change")
    only = tuple(parser.parse_args().only)
    settings.register_profile(
        "mutation",
        deadline=None,
        derandomize=True,
        max_examples=20,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    os.environ["NUMBA_DISABLE_JIT"] = "1"  # else each mutant of a kernel is compiled, and cached
    cores = len(os.sched_getaffinity(0))
    context = multiprocessing.get_context("fork")
    made, survivors = 0, list[str]()
    # One process per module, because each mutant needs a process in which its module was never imported.
    with context.Pool(cores, maxtasksperchild=1) as pool:
        for score in pool.imap_unordered(partial(_score, only=only), TESTS, chunksize=1):
            made += score.made
            survivors += score.survivors
            for place in score.survivors:
                print(f"not noticed: {place}", flush=True)
    share = 1.0 - len(survivors) / max(1, made)
    print(f"{made - len(survivors)} of {made} mutants noticed ({share:.1%})")
    return int(share < MIN_SHARE)


def _score(module: str, only: tuple[str, ...]) -> Score:
    """Try all mutants of one module; raise RuntimeError if its tests fail without a change."""
    path = ROOT / "host" / f"{module.replace('.', '/')}.py"
    chosen = [mutant for mutant in mutants(path) if str(mutant).startswith(only)]
    if not chosen:
        return Score(0, [])
    importlib.import_module(module)
    needed = set(sys.modules)  # nothing of these imports the module, but its packages
    if _run_tests(TESTS[module]):
        raise RuntimeError(f"the tests of {module} fail without a change")
    for name in set(sys.modules) - needed:
        if name.partition(".")[0] in OWN_PACKAGES:
            del sys.modules[name]
    del sys.modules[module]
    return Score(len(chosen), [str(mutant) for mutant in chosen if not _is_noticed(module, mutant)])


def _is_noticed(module: str, mutant: Mutant) -> bool:
    """Run the tests in a fork in which `module` has the code of the mutant; return whether one fails."""
    child = os.fork()
    if child == 0:
        os._exit(_try_mutant(module, mutant))
    _, status = os.waitpid(child, 0)
    return status != 0


def _try_mutant(module: str, mutant: Mutant) -> int:
    signal.alarm(TIMEOUT_S)  # an endless loop counts as noticed
    changed = types.ModuleType(module)
    changed.__file__ = str(mutant.path)
    sys.modules[module] = changed
    setattr(sys.modules[module.rpartition(".")[0]], module.rpartition(".")[2], changed)
    try:
        exec(compile(mutant.tree(), changed.__file__, "exec"), changed.__dict__)
    except Exception:  # noticed by whoever starts the program
        return 1
    return _run_tests(TESTS[module])


def _run_tests(tests: list[str]) -> int:
    """Run the tests in silence; return 0 if all pass."""
    null = os.open(os.devnull, os.O_WRONLY)
    before = os.dup(1), os.dup(2)
    os.dup2(null, 1)
    os.dup2(null, 2)
    settings.load_profile("mutation")
    status = pytest.main(["-x", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--noconftest", *tests])
    os.dup2(before[0], 1)
    os.dup2(before[1], 2)
    return int(status)


if __name__ == "__main__":
    sys.exit(main())
