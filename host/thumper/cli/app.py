"""The `thumper` command. Commands import their modules when they run, so that `--help` is fast."""

import signal
import sys
from functools import partial
from importlib.metadata import entry_points
from itertools import islice
from typing import Any, NoReturn, cast

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup

from thumper.cli import bus
from thumper.cli.bash_completion import in_bash
from thumper.cli.dashboard import dashboard
from thumper.cli.dock import dock
from thumper.cli.doctor import doctor
from thumper.cli.edit import edit
from thumper.cli.explore import explore
from thumper.cli.flash import flash
from thumper.cli.foxglove import foxglove
from thumper.cli.goto import goto, stop
from thumper.cli.map_log import map_log
from thumper.cli.mode import mode
from thumper.cli.parameters import parameters
from thumper.cli.plan import plan
from thumper.cli.record import record
from thumper.cli.recordings import export, recover
from thumper.cli.replay import replay
from thumper.cli.ros import ros
from thumper.cli.run import run
from thumper.cli.save import save
from thumper.cli.setup import setup
from thumper.cli.status import status, watch
from thumper.cli.teleop import teleop
from thumper.cli.usage_errors import (
    UsageError,
    refuse_missing_numbers,
    refuse_unknown_options,
    usage_text,
)
from thumper.common.errors import EXIT_INTERRUPTED, EXIT_USAGE, ThumperError
from thumper.common.optional_packages import extra_providing, missing_package
from thumper.common.parent import end_with_parent
from thumper.common.signals import STOP_SIGNALS
from thumper.common.version import __version__

COMMANDS = {  # plugins of other packages add more
    command.__name__.replace("_", "-"): command
    for command in (
        run,
        explore,
        dock,
        goto,
        stop,
        teleop,
        mode,
        save,
        status,
        watch,
        dashboard,
        record,
        ros,
        foxglove,
        replay,
        export,
        recover,
        map_log,
        plan,
        edit,
        setup,
        doctor,
        flash,
        parameters,
    )
}
PANELS = {  # the order of `thumper --help`
    "Try it without hardware": ("demo", "sim"),
    "Set up a robot": ("setup", "doctor", "flash", "parameters", "bus"),
    "Tune and calibrate": ("tune", "calibrate"),
    "Drive": ("run", "explore", "dock", "goto", "stop", "teleop", "mode", "save"),
    "Watch and connect": ("status", "watch", "dashboard", "ros", "foxglove"),
    "Recordings": ("record", "replay", "export", "recover"),
    "Maps": ("map-log", "plan", "edit"),
    "Measure": ("campaign", "experiment"),
}
OPTION_PANELS = {  # of the commands with many options
    "Goal": (
        "goal",
        "heading",
        "goal_gps",
        "waypoint",
        "patrol",
        "wait",
        "route",
        "tolerance",
        "clear_fault",
        "minutes",
    ),
    "Dashboard": ("ui", "ui_port"),
    "Robot": ("board", "lidar", "config", "speed"),
    "Map": ("start", "saved_map", "session", "fresh"),
    "Output": ("out", "record", "record_to"),
    "Others": ("bus", "help"),
}
START = "Start here: `thumper demo --ui` without a robot, `thumper setup` with one."
TYPES = {  # Typer's names, and those of the help
    "<float range>": "<number>",
    "<float>": "<number>",
    "<int range>": "<whole number>",
    "<int>": "<whole number>",
    "<str>": "<text>",
    "<list[Path]>": "<path>",
    "<list[str]>": "<text>",
}


class ErrorsWithContext:
    """Names the command in the error of an option without its value, which Typer leaves out."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the options of this command."""
        try:
            return cast("list[str]", super().parse_args(ctx, args))  # type: ignore[misc]  # of the command
        except UsageError as error:
            error.ctx = error.ctx or ctx
            raise


class PlainTypes:
    """Shows what an option takes in words: `<number> 0 to 1`. A flag takes no value and shows no type.

    A default that comes from elsewhere, which `show_default` names, appears as the others, without brackets.
    """

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options and arguments."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]  # of the command
        for parameter in parameters:
            parameter.display_type_rich = partial(_type_in_words, parameter)
            parameter._get_number_range_help_str = lambda: None  # the type says it
            if isinstance(parameter.show_default, str):
                parameter._get_default_string = partial(_named_default, parameter.show_default)
        return parameters


def _named_default(text: str, **_: object) -> str:
    return text


def _type_in_words(parameter: Any, ctx: Any) -> str | None:
    if getattr(parameter, "is_flag", False):
        return None
    text = str(type(parameter).display_type_rich(parameter, ctx))
    for name, word in TYPES.items():
        text = text.replace(name, word)
    least, most = (getattr(parameter, name, None) for name in ("min", "max"))
    if least is None and most is None:
        return text
    return f"{text} at least {least}" if most is None else f"{text} {least} to {most}"


class OptionPanels:
    """Shows the options of `run` and `explore`, whose help is long, in the panels of `OPTION_PANELS`."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options and arguments."""
        parameters: list[Any] = super().get_params(ctx)  # type: ignore[misc]  # of the command
        panels = {name: panel for panel, names in OPTION_PANELS.items() for name in names}
        if any(parameter.name not in panels for parameter in parameters):
            return parameters
        for parameter in parameters:
            parameter.rich_help_panel = panels[parameter.name]
        return sorted(parameters, key=lambda parameter: [*OPTION_PANELS].index(panels[parameter.name]))


class PlainGroup(ErrorsWithContext, PlainTypes, TyperGroup):
    """A command with subcommands."""


class Program(PlainGroup):
    """The command `thumper`. Typer lists commands with subcommands last; here `PANELS` orders all."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names in the order of `PANELS`, then those of other packages."""
        order = [name for names in PANELS.values() for name in names]
        names = super().list_commands(ctx)
        return [name for name in order if name in names] + [name for name in names if name not in order]


class PlainCommand(ErrorsWithContext, PlainTypes, OptionPanels, TyperCommand):
    """A command whose arguments appear in capitals, and whose repeated options may take pairs X Y."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        for parameter in self.params:
            if isinstance(parameter, TyperArgument) and parameter.metavar is None:
                parameter.metavar = str(parameter.name).upper()

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Join the pairs of repeated options, `--waypoint X Y`, to X,Y: Typer has no list of pairs.

        Refuse an option that is given twice but takes one value: Click would drop the first without a word.
        """
        given = [word.partition("=")[0] for word in args]
        for parameter in self.params:
            if not getattr(parameter, "multiple", False) and sum(map(given.count, parameter.opts)) > 1:
                raise UsageError(f"{parameter.opts[0]} is given twice, but takes one value", ctx)
        refuse_missing_numbers(ctx, args)
        pairs = {
            name
            for parameter in self.params
            if getattr(parameter, "multiple", False) and parameter.metavar == "X Y"
            for name in parameter.opts
        }
        words, joined = iter(args), list[str]()
        for word in words:
            joined.append(word)
            if word in pairs:
                joined.append(",".join(islice(words, 2)))
        if ctx.ignore_unknown_options:
            refuse_unknown_options(ctx, joined)
        return super().parse_args(ctx, joined)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the pieces of the usage line; Typer puts required arguments in braces."""
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]


def plain(group: typer.Typer) -> typer.Typer:
    """Give the commands of a group the usage lines of the others."""
    for member in group.registered_commands:
        member.cls = PlainCommand
    return group


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"thumper {__version__}")
        raise typer.Exit


def build_app() -> typer.Typer:
    """Build the command line from the commands below and the plugins of other packages."""
    app = typer.Typer(
        cls=Program,
        help="A brain for differential-drive robots: wheel speed control, mapping and navigation.",
        epilog=START,
        no_args_is_help=True,
        rich_markup_mode="markdown",  # in "rich" a unit such as [m] is markup and vanishes
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback()
    def _options(
        version: bool = typer.Option(
            False, "--version", callback=_show_version, is_eager=True, help="Print the version and exit."
        ),
    ) -> None:
        pass

    commands: dict[str, Any] = {**COMMANDS, "bus": bus.app}
    commands |= {plugin.name: plugin.load() for plugin in entry_points(group="thumper.commands")}
    grouped = [(name, panel) for panel, names in PANELS.items() for name in names if name in commands]
    others = [(name, "Others") for name in sorted(commands.keys() - dict(grouped).keys())]
    for name, panel in (*grouped, *others):
        command = commands[name]
        if isinstance(command, typer.Typer):
            app.add_typer(plain(command), name=name, cls=PlainGroup, rich_help_panel=panel)
            continue
        # so that goto accepts negative coordinates
        settings = {"ignore_unknown_options": True} if command is goto else None
        app.command(name, cls=PlainCommand, context_settings=settings, rich_help_panel=panel)(command)
    return app


def main() -> None:
    """Run the command line; print an error that the user can fix as one line, without a traceback."""
    try:
        app = build_app()  # Ctrl-C may end the process during these imports: nothing runs yet
        for number in STOP_SIGNALS:  # all act as Ctrl-C: motors first
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, signal.default_int_handler)
        end_with_parent()
        with in_bash():
            sys.exit(app(prog_name="thumper", standalone_mode=False))
    except UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            print(error.message)  # empty if rich has printed the help
            sys.exit(EXIT_USAGE)
        _exit_with(ThumperError(usage_text(error), exit_code=EXIT_USAGE))
    except typer.Abort as error:  # at a question: Ctrl-C, or nobody is there
        if isinstance(error.__context__, KeyboardInterrupt):
            _exit_with(ThumperError("interrupted", exit_code=EXIT_INTERRUPTED))
        print()  # ends the line of the question
        _exit_with(ThumperError("nobody answers the question; pass --yes to skip it", exit_code=EXIT_USAGE))
    except ThumperError as error:
        _exit_with(error)
    except ModuleNotFoundError as error:
        module = error.name or ""
        extra = extra_providing(module)
        if extra is None:
            raise
        _exit_with(missing_package(extra, module))


def _exit_with(error: ThumperError) -> NoReturn:
    option = f" ({error.option})" if error.option else ""
    print(f"thumper: {error}{option}", file=sys.stderr)
    sys.exit(error.exit_code)
