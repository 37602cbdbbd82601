"""How long the robot lets others go first."""

from dataclasses import dataclass


@dataclass(slots=True)
class Patience:
    """Is over after `limit_s` of waiting in total, for `rest_s`.

    While the robot does not wait, the total falls as slowly.
    """

    limit_s: float
    rest_s: float
    is_over: bool = False
    _waited_s: float = 0.0

    def count(self, period_s: float, *, waits: bool) -> None:
        """Count a cycle."""
        change_s = period_s if waits else -period_s * self.limit_s / self.rest_s
        self._waited_s = max(self._waited_s + change_s, 0.0)
        self.is_over = self._waited_s > (0.0 if self.is_over else self.limit_s)
