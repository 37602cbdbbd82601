"""Searches in slices: a search that takes longer than a control cycle allows goes on in the next cycle.

A search is a generator. It yields after each slice of bounded work, and returns its result. The slices count
cells, not time, so that the same input gives the same run on any computer.
"""

from collections.abc import Generator, Iterator
from typing import Generic, TypeVar

Result = TypeVar("Result")
Search = Generator[None, None, Result]

# Work of one slice: about 5 ms each on the core of a Xeon.
ASTAR_CELLS = 20_000
DIJKSTRA_CELLS = 60_000
LATTICE_NODES = 2_000
BAND_CELLS = 200_000  # of a pass over all cells of a map


def run_to_end(search: Search[Result]) -> Result:
    """Run a search at once and return its result."""
    while True:
        try:
            next(search)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]  # a generator's result has no type here


def merged(search: Search[Result], steps: int) -> Search[Result]:
    """Do `steps` steps of a search in each slice."""
    while True:
        try:
            for _ in range(steps):
                next(search)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        yield


class SlicedSearch(Generic[Result]):
    """At most one search under way; each `advance` does one slice."""

    def __init__(self) -> None:
        self._search: Search[Result] | None = None

    @property
    def is_running(self) -> bool:
        """Whether a search is under way."""
        return self._search is not None

    def start(self, search: Search[Result]) -> None:
        """Start a search; drop the one under way."""
        self._search = search

    def stop(self) -> None:
        """Drop the search under way."""
        self._search = None

    def advance(self) -> Result | None:
        """Do one slice; return the result at the search's end, else None."""
        if self._search is None:
            return None
        try:
            next(self._search)
        except StopIteration as end:
            self._search = None
            return end.value  # type: ignore[no-any-return]
        return None


def bands_of(shape: tuple[int, int]) -> Iterator[slice]:
    """Yield the rows of an array in bands of about `BAND_CELLS` cells."""
    rows, cols = shape
    step = max(1, BAND_CELLS // max(1, cols))
    for begin in range(0, rows, step):
        yield slice(begin, min(rows, begin + step))
