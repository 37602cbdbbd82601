"""Put into a wheel what a user without the source tree needs: firmware of each board, simulated chip, set-up.

An editable install takes them from the source tree, where `make` builds the first two.
"""

import subprocess
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BOARDS = {"trex": "firmware/build", "nano": "firmware/build/nano"}
CHIP = "hil/thumper_hil/chip/native"
SET_UP = ("99-thumper.rules", "thumper.service")


class FirmwareHook(BuildHookInterface):  # type: ignore[type-arg]
    """Build both with make, and pack them."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling ahead of a wheel; `version` is "editable" for an editable install."""
        if self.target_name != "wheel" or version == "editable":
            return
        root = Path(self.root)
        for board in BOARDS:
            subprocess.run(["make", "-s", "-C", root / "firmware", f"BOARD={board}"], check=True)
        subprocess.run(["make", "-s", "-C", root / CHIP], check=True)
        library = "build/libthumper_chip.so"
        build_data["force_include"] |= {f"{CHIP}/{library}": f"thumper_hil/chip/native/{library}"} | {
            f"{folder}/thumper.{suffix}": f"thumper/images/{board}/thumper.{suffix}"
            for board, folder in BOARDS.items()
            for suffix in ("elf", "hex")
        }
        build_data["force_include"] |= {f"packaging/{name}": f"thumper/packaging/{name}" for name in SET_UP}
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data |= {"pure_python": False, "tag": f"py3-none-{platform}"}
