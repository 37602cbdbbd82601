"""Where a map differs from earlier renders of it, so that its readers need not compare all cells."""

from dataclasses import dataclass
from typing import NamedTuple

REMEMBERED_RENDERS = 64  # a reader that has missed more reads the whole map


class CellBox(NamedTuple):
    """Rows `top` to `bottom` - 1 and columns `left` to `right` - 1."""

    top: int
    left: int
    bottom: int
    right: int

    @property
    def is_empty(self) -> bool:
        """Whether no cell is inside."""
        return self.bottom <= self.top or self.right <= self.left

    @property
    def cells(self) -> int:
        """The number of cells inside."""
        return 0 if self.is_empty else (self.bottom - self.top) * (self.right - self.left)

    @property
    def window(self) -> tuple[slice, slice]:
        """The box as an index of an array, shape (rows, columns)."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def union(self, other: "CellBox") -> "CellBox":
        """Return the smallest box round both."""
        if self.is_empty or other.is_empty:
            return other if self.is_empty else self
        return CellBox(
            min(self.top, other.top),
            min(self.left, other.left),
            max(self.bottom, other.bottom),
            max(self.right, other.right),
        )


NO_CELLS = CellBox(0, 0, 0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class RenderHistory:
    """A render of a map, and the boxes in which the newest renders differ from the ones before them."""

    source: object  # one per map and extent: renders of different sources cannot be compared
    number: int = 0
    boxes: tuple[CellBox, ...] = ()  # the newest last

    def next(self, changed: CellBox) -> "RenderHistory":
        """Return the history of the next render, which differs from this one in a box."""
        return RenderHistory(self.source, self.number + 1, (*self.boxes, changed)[-REMEMBERED_RENDERS:])

    def changed_since(self, older: "RenderHistory | None") -> CellBox | None:
        """Return the box round all changes since an older render; None if they are not known."""
        if older is None or older.source is not self.source:
            return None
        missed = self.number - older.number
        if not 0 <= missed <= len(self.boxes):
            return None
        changed = NO_CELLS
        for box in self.boxes[len(self.boxes) - missed :]:
            changed = changed.union(box)
        return changed


def new_history() -> RenderHistory:
    """Return the history of a map that differs from no other one in a known box."""
    return RenderHistory(object())
