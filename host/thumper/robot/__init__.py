"""`Robot` for scripts and notebooks."""

from thumper.robot.robot import Robot

__all__ = ["Robot"]
