"""The one exception that a user may see: it says what is wrong and what cures it, in one line."""

EXIT_USAGE = 2  # wrong input
EXIT_NOT_THERE = 3  # a device, or the robot that is asked, is missing or does not answer
EXIT_CHECK_FAILED = 4  # of the robot, of data, or that what the command needs is installed
EXIT_INTERRUPTED = 130  # by Ctrl-C, as a shell expects


class ThumperError(Exception):
    """A fault that the user can mend. The message is one line: what is wrong, then the cure.

    The command line prints it without a traceback and leaves with `exit_code`: 1, or one of those above.
    `option` is the command's option that is the cure there; the page and other programs, which have none,
    show the message alone.
    """

    def __init__(self, message: str, *, exit_code: int = 1, option: str = "") -> None:
        super().__init__(message)
        self.exit_code = exit_code
        self.option = option
