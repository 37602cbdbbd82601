"""The faults that are active at a bench: plugs, serial line, left and right side."""

from dataclasses import dataclass, field, replace
from typing import Any

from thumper_hil.chip.chip_faults import FaultyChip, SideFaults

DEVICES = ("board", "lidar", "imu", "gps", "camera")  # in `sim://NAME/DEVICE`; each has a plug
SIDES = {"left": 0, "right": 1}
CHANNELS = {"a": 0, "b": 1}


@dataclass(slots=True, kw_only=True)
class Switches:
    """The state of a bench's faults. The bench reads plugs and host hang; the chip gets the rest."""

    chip: FaultyChip
    unplugged: set[str] = field(default_factory=set)  # board, lidar...
    host_hangs_until_s: float = 0.0
    sky_is_blocked: bool = False  # the GPS receiver loses its fix
    gps_offset_m: float = 0.0  # of all positions, to the east
    line_loss: float = 0.0
    line_flip: float = 0.0
    roll_rad: float = 0.0
    sides: list[SideFaults] = field(default_factory=lambda: [SideFaults(), SideFaults()])

    def change_side(self, side: int, **changes: Any) -> None:
        """Change the given faults of a side and keep its others."""
        self.sides[side] = replace(self.sides[side], **changes)
        self.chip.set_side_faults(side, self.sides[side])

    def set_line(self, **changes: float) -> None:
        """Set `line_loss` or `line_flip` of the serial line."""
        for name, value in changes.items():
            setattr(self, name, value)
        self.chip.set_line_noise(loss=self.line_loss, flip=self.line_flip)
