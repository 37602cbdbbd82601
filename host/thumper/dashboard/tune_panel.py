"""Experiments of the robot: identify the motors, tune the wheels' control."""

from nicegui import ui

from thumper.dashboard.parameters import Asker


def tune_panel(robot: Asker) -> None:
    """Put the panel where NiceGUI is."""
    ui.html("<p>…</p>", sanitize=False)
