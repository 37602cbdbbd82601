"""Options that several commands share: each has one name and one help text."""

from importlib.metadata import entry_points
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer


def _ports(incomplete: str) -> list[str]:
    """Return what Tab offers for a port: serial ports and simulated robots; their worlds after `sim`."""
    from thumper.doctor.usb_ports import usb_ports

    offered = [*(port.device for port in usb_ports()), "sim://"]
    if incomplete.startswith("sim"):
        plugins = entry_points(group="thumper.serial_protocols")
        offered += chain(*(getattr(plugin.load(), "urls", list)() for plugin in plugins))
    return [port for port in offered if port.startswith(incomplete)]


BoardPort = Annotated[
    str,
    typer.Option(
        "--board",
        help="Serial port of the board, or sim:// to simulate; overrides the configuration.",
        autocompletion=_ports,
    ),
]
LidarPort = Annotated[
    str,
    typer.Option(
        "--lidar",
        help="Serial port or URL of the lidar; overrides the configuration.",
        autocompletion=_ports,
    ),
]
ConfigFile = Annotated[
    Path | None, typer.Option("--config", help="TOML file of the robot; without it, a Wild Thumper.")
]
BusAddress = Annotated[str, typer.Option("--bus", help="HOST:PORT of the bus; overrides the configuration.")]
PageHost = Annotated[
    str,
    typer.Option("--host", help="Address to listen on; any other than loopback needs a password and HTTPS."),
]
PagePort = Annotated[
    int, typer.Option("--port", help="Port to listen on; 0: as configured.", min=0, max=65535)
]
RobotName = Annotated[
    str, typer.Option("--robot", help="Name of the robot on the bus; overrides the configuration.")
]
StartPose = Annotated[
    tuple[float, float, float] | None,
    typer.Option(
        "--start",
        metavar="X Y DEGREES",
        help="Start pose in the map: X and Y in metres, heading in degrees. Without it: the origin, or, "
        "with a saved map or session, global localization.",
    ),
]
SavedMap = Annotated[
    Path | None, typer.Option("--map", help="Localize in this saved map (.yaml) instead of mapping.")
]
Session = Annotated[
    Path | None, typer.Option("--session", help="Continue mapping from this saved session (map.session).")
]
Fresh = Annotated[
    bool,
    typer.Option("--fresh", help="Start a new map, even if the last run into --out did not end normally."),
]
GoalTolerance = Annotated[
    float, typer.Option("--tolerance", min=0.02, max=1.0, help="Allowed distance from the goal, in metres.")
]
ClearFault = Annotated[bool, typer.Option("--clear-fault", help="Clear a fault that the board has latched.")]
Record = Annotated[bool, typer.Option("--record", help="Record everything to the configured folder.")]
RecordTo = Annotated[Path | None, typer.Option("--record-to", help="Record everything to this folder.")]
RunFolder = Annotated[
    Path, typer.Option("--out", help="Folder for the map, session, pictures and summary.json.")
]
MapFolder = Annotated[
    Path,
    typer.Option("--out", help="Folder for map.pgm, map.yaml, map.session, map.png and trajectory.csv."),
]
Recordings = Annotated[
    list[Path], typer.Argument(help="Recordings (.mcap) of one run in order, or a folder: its newest run.")
]
Ui = Annotated[bool, typer.Option("--ui", help="Also serve the dashboard; see `thumper dashboard`.")]
UiPort = Annotated[
    int,
    typer.Option("--ui-port", help="Port of the dashboard of --ui; 0: as configured.", min=0, max=65535),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
