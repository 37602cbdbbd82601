"""Which modules a fresh interpreter has loaded after some code: start-up must stay short."""

import subprocess
import sys
from collections.abc import Iterable


def printed_and_loaded(code: str, modules: Iterable[str]) -> tuple[str, set[str]]:
    """Run code in a fresh interpreter; return what it prints, and which of the modules it has loaded."""
    listed = f"\nimport sys; print(*({set(modules)!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code + listed], capture_output=True, text=True, check=True)
    printed, _, loaded = done.stdout.removesuffix("\n").rpartition("\n")
    return printed, set(loaded.split())


def help_of(*command: str) -> str:
    """Return code that prints the help of a command of `thumper`."""
    return (
        f"import sys; sys.argv = {['thumper', *command, '--help']!r}\n"
        "from thumper.cli.app import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
    )
