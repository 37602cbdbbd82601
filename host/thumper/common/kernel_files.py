"""Where compiled kernels are kept, which processor they are for, and which sources they were made from.

`kernels/` in a package holds its kernels, compiled when the package was made. They use what most processors
of their kind have, so that they fit most computers. Any other computer compiles at the first run.
"""

import hashlib
import re
import sys
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core import config as numba_config

FOLDER = "kernels"
SHARED_CPU = "x86-64-v3"  # most PCs since 2013
SHARED_CPU_FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")
IMPORTED = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)


def choose_processor() -> None:
    """Compile for `SHARED_CPU` if this computer can run its code, unless NUMBA_CPU_NAME names another."""
    config: Any = numba_config  # numba makes its attributes from the environment
    if config.CPU_NAME is not None or not llvm.get_process_triple().startswith("x86_64"):
        return
    features = llvm.get_host_cpu_features()
    if all(features.get(name, False) for name in SHARED_CPU_FEATURES):
        config.CPU_NAME, config.CPU_FEATURES = SHARED_CPU, ""


def kernel_folder(module: str) -> Path | None:
    """Return where the package of a module keeps the module's compiled kernels; None without a package."""
    package = getattr(sys.modules.get(module.partition(".")[0]), "__file__", None)
    return None if package is None or "." not in module else Path(package).parent / FOLDER / module


@cache
def source_hash(module: str) -> str:
    """Return a hash of a module's source, of all that it imports from its own project, and of the compiler.

    A kernel contains the kernels and constants that its module imports. With this hash as its stamp it is
    never used with other ones. The module must have been imported, and its imports must not form a circle.
    """
    file = getattr(sys.modules.get(module), "__file__", None)
    source = Path(file).read_bytes() if file else b""
    hashed = hashlib.sha256(repr((numba.__version__, llvm.llvm_version_info)).encode() + source)
    names = (name.decode() for name in IMPORTED.findall(source))
    for name in sorted({name for name in names if _is_ours(name) and name != module}):
        hashed.update(source_hash(name).encode())
    return hashed.hexdigest()


def _is_ours(module: str) -> bool:
    return module.startswith("thumper") and module in sys.modules
