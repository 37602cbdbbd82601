"""The commands of `thumper tune`. Heavy imports wait until a command runs."""

import typer

app = typer.Typer(help="Identify the motors and tune the wheels' speed control.", no_args_is_help=True)


@app.callback()
def _tune() -> None:
    pass
