"""What can be done to a simulated robot: faults, the world, the speed of its clock."""

from nicegui import ui

from thumper.dashboard.parameters import Asker


def simulator_panel(robot: Asker) -> None:
    """Put the panel where NiceGUI is."""
    ui.html("<p>…</p>", sanitize=False)
