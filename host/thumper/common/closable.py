"""Base class of objects that a `with` statement closes."""

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Adds the context manager methods to a class that has a `close` method."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
