"""The complete simulated robot. pyserial finds `protocol_sim` here for `sim://` URLs."""

from thumper_hil.bench.bench import DEFAULT_ELF, Bench
from thumper_hil.bench.registry import simulation
from thumper_hil.chip.native_library import LIBRARY
from thumper_hil.world.world_file import suggested_worlds

__all__ = ["DEFAULT_ELF", "Bench", "missing_parts", "simulation", "urls"]


def missing_parts() -> str:
    """Return which part is not built and how to build it; empty if everything is built."""
    for path, target in ((DEFAULT_ELF, "firmware"), (LIBRARY, "chip")):
        if not path.exists():
            return f"{path.name} is not built; run `make {target}` in the repository"
    return ""


def urls() -> list[str]:
    """Return the URL of each world that Tab offers."""
    return [f"sim://?world={name}" for name in suggested_worlds()]
