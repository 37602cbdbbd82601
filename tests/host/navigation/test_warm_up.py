"""Before the robot is armed, the warm-up has compiled every kernel that the loop calls."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import thumper

PACKAGE = Path(thumper.__file__).parent
# Of planners, controllers and mappers that are not the default ones: they are warmed up if they are selected.
NOT_IN_THE_LOOP = {
    "thumper.navigation.controllers.mppi_kernels",
    "thumper.navigation.planners.carrot",
    "thumper.navigation.planners.gradient_path",
    "thumper.slam.particle_filter",
}
WARM = """
import sys
from thumper.common.numba_kernel import Kernel
from thumper.config.robot import RobotConfig
from thumper.runtime.assembly import warm_up

warm_up(RobotConfig())
for name, module in list(sys.modules.items()):
    for value in vars(module).values() if name.startswith("thumper.") else ():
        if isinstance(value, Kernel):
            print(value.__module__, value.__name__, len(value.compiled.signatures))
"""


def is_kernel(function: ast.FunctionDef) -> bool:
    names = [ast.unparse(decorator) for decorator in function.decorator_list]
    return any(name == "kernel" or name.startswith("member(") for name in names)


def called_from_python() -> set[str]:
    """Return module and name of the functions that functions other than kernels call by their name."""
    called: set[str] = set()

    def visit(node: ast.AST, origin: dict[str, str]) -> None:
        if isinstance(node, ast.FunctionDef) and is_kernel(node):
            return
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in origin:
            called.add(f"{origin[node.func.id]} {node.func.id}")
        for child in ast.iter_child_nodes(node):
            visit(child, origin)

    for path in PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        module = ".".join(("thumper", *path.relative_to(PACKAGE).with_suffix("").parts))
        origin = {node.name: module for node in tree.body if isinstance(node, ast.FunctionDef)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                origin |= {alias.name: node.module for alias in node.names}
        visit(tree, origin)
    return called


def test_the_warm_up_calls_every_kernel_that_the_loop_calls() -> None:
    """A kernel that only kernels call was compiled with them."""
    done = subprocess.run([sys.executable, "-c", WARM], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    called = called_from_python()
    kernels = {tuple(line.split()) for line in done.stdout.splitlines()}
    assert len(kernels) > 100
    cold = sorted(
        f"{module}.{name}"
        for module, name, signatures in kernels
        if signatures == "0"
        and f"{module} {name}" in called
        and not module.startswith(tuple(NOT_IN_THE_LOOP))
    )
    assert not cold, cold


# Without the matching, whose kernels take no part in this and would be compiled again for it.
FINE = """
from unittest.mock import Mock

from thumper.slam.factory import MappingOptions
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.scan_matching.patch_grid import plain

GridMapper._matcher = lambda _: Mock()
GridMapper.update = lambda *_: None
mapper = GridMapper(MappingOptions(resolution_m=0.025))
mapper.warm_up()
signatures = len(plain.compiled.signatures)
mapper.hit_grid.distances_m(1)
print(signatures, len(plain.compiled.signatures))
"""


@pytest.mark.slow
def test_the_warm_up_compiles_for_the_distances_of_a_fine_map() -> None:
    """They take two bytes per cell there."""
    done = subprocess.run([sys.executable, "-c", FINE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    before, after = done.stdout.split()
    assert before == after
