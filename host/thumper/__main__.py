"""Entry of the `thumper` command. It handles Ctrl-C before the slow imports."""

import os
import signal

from thumper.common.errors import EXIT_INTERRUPTED


def main() -> None:
    """Load the command line and run it; until it is there, Ctrl-C or a polite kill just ends the process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # a shell's `&` makes it ignored
            # Not an exception: an import that is interrupted halfway may turn it into another error.
            signal.signal(number, lambda *_: os._exit(EXIT_INTERRUPTED))
    from thumper.cli.app import main as run_command

    run_command()


if __name__ == "__main__":
    main()
