"""The simulated robot as a whole. pyserial finds `protocol_sim` here for `sim://` URLs."""

from thumper_hil.bench.bench import DEFAULT_ELF, Bench
from thumper_hil.bench.registry import simulation

__all__ = ["DEFAULT_ELF", "Bench", "simulation"]
