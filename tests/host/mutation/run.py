"""Mutation test of what decides who may command the robot, and with what.

python -m tests.host.mutation.run                    all mutants (`make mutation`)
python -m tests.host.mutation.run --only login.py:80    those whose printed place starts so

Each mutant runs in a fork with the tests of its file, which need neither server nor robot. The command lists
the survivors and fails if the tests notice less than 90 %.
"""

import argparse
import ast
import importlib
import os
import signal
import sys
import types
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, settings

from tests.host.mutation.mutants import Mutant, mutants

ROOT = Path(__file__).resolve().parents[3]
TESTS = {
    "thumper.dashboard.login": ["tests/dashboard/test_access.py"],
    "thumper.dashboard.rate_limit": [
        "tests/dashboard/test_page_messages.py",
        "tests/dashboard/test_access.py",
    ],
    "thumper.dashboard.page_messages": ["tests/dashboard/test_page_messages.py"],
    "thumper.dashboard.page_commands": ["tests/dashboard/test_page_commands.py"],
    "thumper.bus.request_decoder": ["tests/host/bus/test_request_decoder.py"],
    "thumper.runtime.service.request_queue": ["tests/host/runtime/service/test_request_queue.py"],
}
"""The module of each mutant, and the tests that should notice it."""
PRELOADED = (
    *("numpy", "pydantic", "starlette.responses", "starlette.requests", "thumper.ros.codec"),
    *("thumper.ros.from_ros", "thumper.ros.services", "thumper.ros.to_ros", "thumper.navigation.goal"),
    *("thumper.runtime.requests", "thumper.config.bus", "thumper.dashboard.pose_history"),
    *("thumper.dashboard.binary_packet", "matplotlib.image", "hypothesis.strategies", "_pytest.doctest"),
)
TIMEOUT_S = 60
MIN_SHARE = 0.9


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
    for name in PRELOADED:
        importlib.import_module(name)
    counted, survivors = 0, list[Mutant]()
    for module, tests in TESTS.items():
        path = ROOT / "host" / f"{module.replace('.', '/')}.py"
        chosen = [mutant for mutant in mutants(path) if str(mutant).startswith(only)]
        if not chosen:
            continue
        if not _is_noticed(module, ast.parse(path.read_text(encoding="utf-8")), tests):
            for mutant in chosen:
                counted += 1
                if not _is_noticed(module, mutant.tree, tests):
                    survivors.append(mutant)
                    print(f"not noticed: {mutant}", flush=True)
        else:
            print(f"the tests of {module} fail without a change")
            return 1
    share = 1.0 - len(survivors) / max(1, counted)
    print(f"{counted - len(survivors)} of {counted} mutants noticed ({share:.1%})")
    return int(share < MIN_SHARE)


def _is_noticed(module: str, tree: ast.Module, tests: list[str]) -> bool:
    """Run the tests in a fork in which `module` has the code of `tree`; return whether one fails."""
    child = os.fork()
    if child == 0:
        os._exit(_run_tests(module, tree, tests))
    _, status = os.waitpid(child, 0)
    return status != 0


def _run_tests(module: str, tree: ast.Module, tests: list[str]) -> int:
    signal.alarm(TIMEOUT_S)  # an endless loop counts as noticed
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    assert module not in sys.modules, f"{module} was imported before it was changed"
    package = importlib.import_module(module.rpartition(".")[0])
    changed = types.ModuleType(module)
    changed.__file__ = str(ROOT / "host" / f"{module.replace('.', '/')}.py")
    sys.modules[module] = changed
    setattr(package, module.rpartition(".")[2], changed)
    try:
        exec(compile(tree, changed.__file__, "exec"), changed.__dict__)
    except Exception:  # noticed by whoever starts the program
        return 1
    settings.load_profile("mutation")
    return int(pytest.main(["-x", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--noconftest", *tests]))


if __name__ == "__main__":
    sys.exit(main())
