"""`thumper bus`: keys that encrypt the bus."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(
    no_args_is_help=True, help="Make the keys of an encrypted bus.\n\nExample: `thumper bus keys`"
)


@app.command()
def keys(
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for the keys; without it, where robot and clients look for them."),
    ] = None,
) -> None:
    """Make the certificates with which robot and clients recognize each other on a network.

    Run it once on the robot's computer. Copy ca.crt, client.crt and client.key to the same folder of each
    other computer that may connect.
    """
    from thumper.bus.keys import default_folder, make_keys

    folder = out or default_folder()
    files = make_keys(folder)
    print(f"in {folder}/: {', '.join(path.name for path in files)}")
    print("copy ca.crt, client.crt and client.key to each computer that may connect, and keep them secret")
