"""What is broken at a bench at the moment: plugs, the line, the sides, piece by piece."""

from dataclasses import dataclass, field, replace
from typing import Any

from thumper.common.geometry import Pose2
from thumper_hil.chip.chip_faults import FaultyChip, SideFaults, WireFault

SIDES = {"left": 0, "right": 1}
CHANNELS = {"a": 0, "b": 1}


@dataclass(slots=True, kw_only=True)
class Switches:
    """The state of a bench's faults. The bench reads the plugs and the hang; the rest goes to the chip."""

    chip: FaultyChip
    board_plugged: bool = True
    lidar_plugged: bool = True
    host_hangs_until_s: float = 0.0
    line_loss: float = 0.0
    line_flip: float = 0.0
    sides: list[SideFaults] = field(default_factory=lambda: [SideFaults(), SideFaults()])

    def change_side(self, side: int, **changes: Any) -> None:
        """Change some of a side's faults and leave its others."""
        self.sides[side] = replace(self.sides[side], **changes)
        self.chip.set_side_faults(side, self.sides[side])

    def break_wire(self, side: int, channel: int, fault: WireFault) -> None:
        """Break or mend an encoder's wire."""
        self.chip.set_wire_fault(side, channel, fault)

    def set_line(self, **changes: float) -> None:
        """Change the line's `line_loss` or `line_flip`."""
        for name, value in changes.items():
            setattr(self, name, value)
        self.chip.set_line_noise(loss=self.line_loss, flip=self.line_flip)

    def carry_to(self, pose: Pose2) -> None:
        """Lift the robot and put it down elsewhere."""
        self.chip.place(pose)
