"""Errors of the command line's parser as one line each: what is wrong, then how to fix it."""

import re
from typing import Any

import typer

from thumper.common.texts import close_names, is_number

# Typer brings click's exceptions, in newer versions as a copy of its own.
UsageError: Any = typer.BadParameter.__base__

MEANT = {
    "goal": "goto",
    "navigate": "goto",
    "drive": "teleop",
    "slam": "run",
    "upload": "flash",
    "check": "doctor",
}
"""Names that other robot programs have for our commands, which they do not resemble."""


def usage_text(error: Any) -> str:
    """Return the line for a parser error: the command, the problem, and where its options are listed."""
    context = error.ctx
    command = context.command_path if context else "thumper"
    if type(error).__name__ == "NoSuchOption":
        problem = no_such_option(context, error.option_name)
    else:
        _name_the_value(error)
        problem = " ".join(error.format_message().split()).removesuffix(".")
        problem = (problem[:1].lower() + problem[1:]).replace(". Did you mean", "; did you mean")
        unknown = problem.partition(";")[0]
        if meant := MEANT.get(unknown.removeprefix("no such command ").strip("'")):
            problem = f"{unknown}; did you mean '{meant}'?"
    subcommand = command.removeprefix("thumper").strip()
    where = f"{subcommand}: " if subcommand else ""
    joint = " See" if problem.endswith("?") else "; see"
    return f"{where}{problem}{joint} `{command} --help`"


def _name_the_value(error: Any) -> None:
    """Turn pydantic's "Input should be a valid number, unable to ..." into "'a' must be a valid number"."""
    cause = error.__cause__
    if hasattr(cause, "errors"):
        first = cause.errors(include_url=False)[0]
        if first["type"] == "value_error":  # of Typer: "'a' is not one of 'b', 'c'."
            error.message = _with_meant(str(first["ctx"]["error"]))
        else:
            rule = first["msg"].replace("Input should", "must").partition(",")[0]
            error.message = f"{first['input']!r} {rule}"


def _with_meant(message: str) -> str:
    """Return Typer's "'a' is not one of 'b', 'c'." with the choice that was meant, if one resembles it."""
    typed, _, choices = message.partition(" is not one of ")
    close = close_names(typed.strip("'"), re.findall("'([^']+)'", choices))
    return f"{message.removesuffix('.')}; did you mean {close[0]!r}?" if close else message


def no_such_option(context: Any, word: str) -> str:
    """Return the problem with a mistyped option, and the options that it resembles."""
    name = word.partition("=")[0]
    options = [name for parameter in context.command.get_params(context) for name in parameter.opts]
    close = [
        f"--{known}" for known in close_names(name.strip("-"), [option.strip("-") for option in options])
    ]
    return f"no such option {name}" + (f"; did you mean {' or '.join(close)}?" if close else "")


def refuse_unknown_options(context: Any, words: list[str]) -> None:
    """Raise for the first unknown option of a command that takes negative numbers as arguments."""
    known = {
        name
        for parameter in context.command.get_params(context)
        for name in (*parameter.opts, *parameter.secondary_opts)
    }
    for word in words:
        if word == "--":
            return
        if word.startswith("-") and word.partition("=")[0] not in known and not is_number(word):
            context.fail(no_such_option(context, word))


def refuse_missing_numbers(context: Any, words: list[str]) -> None:
    """Raise for an option of several numbers, such as `--goal X Y`, with fewer before the next option.

    Click would take the next option's name for a number.
    """
    metavars = {
        name: parameter.metavar
        for parameter in context.command.params
        if len((parameter.metavar or "").split()) > 1
        for name in parameter.opts
        if name.startswith("-")
    }
    for index, word in enumerate(words):
        option, is_joined, first = word.partition("=")
        if word == "--":
            return
        if option not in metavars:
            continue
        values = [*([first] if is_joined else []), *words[index + 1 :]]
        for position, name in enumerate(metavars[option].split()):
            value = values[position] if position < len(values) else "--"
            if value.startswith("-") and not is_number(value):
                raise UsageError(f"{option} is {metavars[option]}: the {name} is missing", context)
