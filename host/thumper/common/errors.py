"""The exception for every error that a user can fix, and the exit statuses of the commands."""

EXIT_USAGE = 2  # invalid input: also a file that is not what the command reads
EXIT_NOT_THERE = 3  # no device, or a device or robot that does not answer
EXIT_CHECK_FAILED = 4  # a check of the robot or of a file's data failed, or a required package is missing
EXIT_INTERRUPTED = 130  # by Ctrl-C, as a shell expects


MAX_MESSAGE = 1000  # characters


def one_line(text: str) -> str:
    """Return the text as one printable line: a file's content that it quotes may hold anything."""
    plain = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[:MAX_MESSAGE])
    return plain if len(text) <= MAX_MESSAGE else f"{plain}..."


class ThumperError(Exception):
    """An error that the user can fix. The message is one line: what is wrong, then how to fix it.

    The command line prints the message without a traceback and exits with `exit_code`: 1, or one of the
    `EXIT_` constants. `option` names the command-line option that fixes the error. Dashboard and bus clients
    have no options; they show the message alone.

    An error of `EXIT_USAGE` is a `UsageError`, one of `EXIT_NOT_THERE` a `NotThereError`.
    """

    def __new__(cls, *args: object, exit_code: int = 1, **named: object) -> "ThumperError":
        """Choose the class by the exit code, so that no place that raises needs to name both."""
        kinds = {EXIT_USAGE: UsageError, EXIT_NOT_THERE: NotThereError}
        return super().__new__(kinds.get(exit_code, cls) if cls is ThumperError else cls, *args)

    def __init__(self, message: str, *, exit_code: int = 1, option: str = "") -> None:
        super().__init__(one_line(message))
        self.exit_code = exit_code
        self.option = option


class UsageError(ThumperError):
    """Invalid input: a wrong argument, or a file that is missing or wrong."""


class NotThereError(ThumperError):
    """No such device or robot, or it does not answer."""
