"""What `with` closes on the way out."""

from abc import ABC, abstractmethod
from typing import Self


class Closable(ABC):
    """Give it a `close`, and it can be used in a `with` statement."""

    @abstractmethod
    def close(self) -> None:
        """Let go of what it holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
