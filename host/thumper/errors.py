"""The one exception that a user may see: it says what is wrong and what cures it, in one line."""


class ThumperError(Exception):
    """A fault that the user can mend. The message is one line: what is wrong, then the cure.

    The command line prints it without a traceback and leaves with `exit_code` (1 failure, 2 usage,
    3 hardware not found, 4 check failed or part not installed, 130 Ctrl-C). `option` is the command's option
    that is the cure there; the page and other programs, which have none, show the message alone.
    """

    def __init__(self, message: str, *, exit_code: int = 1, option: str = "") -> None:
        super().__init__(message)
        self.exit_code = exit_code
        self.option = option
