"""Put into a wheel what a user without the source tree needs: firmware, simulated chip, kernels, set-up.

The kernels are compiled for the Python and numba of the build, if it has numba: see docs/howto/platforms.md.

An editable install takes them from the source tree, where `make` builds the first two.

scripts/build-wheel builds for other machines: with CHIP_TARGET and SIMAVR (see the chip's Makefile), and with
_PYTHON_HOST_PLATFORM as in CPython's own build.
"""

import os
import subprocess
import sys
import sysconfig
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BOARDS = {"trex": "firmware/build", "nano": "firmware/build/nano"}
CHIP = "hil/thumper_hil/chip/native"
KERNELS = {
    f"{folder}/kernels": f"{Path(folder).name}/kernels"
    for folder in ("host/thumper", "hil/thumper_hil", "tuning/thumper_tuning")
}
SET_UP = {
    f"packaging/{name}": name for name in ("99-thumper.rules", "thumper.service", "foxglove-layout.json")
}
SET_UP |= {"docs/images/wiring.svg": "wiring.svg"}


class FirmwareHook(BuildHookInterface):  # type: ignore[type-arg]
    """Build both with make, and pack them."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling ahead of a wheel; `version` is "editable" for an editable install."""
        if self.target_name != "wheel" or version == "editable":
            return
        root = Path(self.root)
        for board in BOARDS:
            subprocess.run(["make", "-s", "-C", root / "firmware", f"BOARD={board}"], check=True)
        subprocess.run(["make", "-s", f"-j{os.cpu_count()}", "-C", root / CHIP], check=True)
        library = "libthumper_chip.so"
        folder = Path("build", os.environ.get("CHIP_TARGET", ""))
        built = {f"{CHIP}/{folder / library}": f"thumper_hil/chip/native/build/{library}"}
        build_data["force_include"] |= built | {
            f"{folder}/thumper.{suffix}": f"thumper/images/{board}/thumper.{suffix}"
            for board, folder in BOARDS.items()
            for suffix in ("elf", "hex")
        }
        build_data["force_include"] |= {path: f"thumper/packaging/{name}" for path, name in SET_UP.items()}
        other_machine = not sysconfig.get_platform().endswith(os.uname().machine)
        if kernels := find_spec("numba") is not None and not other_machine:
            paths = os.pathsep.join(str(root / folder) for folder in ("host", "hil", "tuning"))
            environment = os.environ | {"PYTHONPATH": paths, "THUMPER_SHIP_KERNELS": "1"}
            command = [sys.executable, root / "scripts" / "ship_kernels.py"]
            subprocess.run(command, check=True, env=environment)
            build_data["force_include"] |= KERNELS
        else:
            self.app.display_warning("no kernels: the first run of this wheel compiles them")
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        python = f"cp{sys.version_info.major}{sys.version_info.minor}" if kernels else "py3"
        build_data |= {"pure_python": False, "tag": f"{python}-none-{platform}"}
