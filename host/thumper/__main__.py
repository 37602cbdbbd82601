"""Entry of the `thumper` command. It handles Ctrl-C before the slow imports."""

import gc
import os
import signal
import sys

from thumper.common.errors import EXIT_INTERRUPTED


def main() -> None:
    """Load and run the command line; until it is loaded, Ctrl-C and SIGTERM end the process at once."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # a shell ignores it for `command &`
            # No exception: an interrupted import may turn it into another error.
            signal.signal(number, lambda *_: os._exit(EXIT_INTERRUPTED))
    gc.disable()  # a tenth of the start
    from thumper.cli.app import main as run_command

    gc.freeze()  # what imports leave behind stays: no collection looks at it
    gc.enable()
    try:
        run_command()
    except KeyboardInterrupt:  # a second Ctrl-C, while the first one ended the command
        _leave()
    except SystemExit as end:
        if end.code != EXIT_INTERRUPTED:
            raise
        _leave()


def _leave() -> None:
    """Exit at once: a second Ctrl-C may leave a thread of the bus, which aborts at a regular exit."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(EXIT_INTERRUPTED)


if __name__ == "__main__":
    main()
