"""Mutation test of the firmware: changes it at one place, and a test must notice.

core: firmware/core, built for the PC, with the tests that need no chip.
board: firmware/app and firmware/board, with the tests on the emulated chip.
Fails unless the mutants that no test notices are exactly those that *_survivors.toml lists.

python -m tests.firmware.mutation.run core                  all of them (`make mutation`)
python -m tests.firmware.mutation.run board --sample 20     a random sample, by --seed
python -m tests.firmware.mutation.run core --only pi.hpp battery.hpp:35:  those whose printed place starts so
"""

import argparse
import os
import random
import signal
import sys

from tests.firmware.mutation.board_mutants import board_mutants
from tests.firmware.mutation.board_suite import BOARD_SUBJECT
from tests.firmware.mutation.core_mutants import core_mutants
from tests.firmware.mutation.core_suite import CORE_SUBJECT
from tests.firmware.mutation.survivors import BOARD_SURVIVORS, CORE_SURVIVORS, Tally
from tests.firmware.mutation.worker import results_of

PARTS = {
    "core": (CORE_SUBJECT, core_mutants, CORE_SURVIVORS),
    "board": (BOARD_SUBJECT, board_mutants, BOARD_SURVIVORS),
}
MIN_SHARE = 0.99
"""Of all mutants that are not equivalent."""


def main() -> int:
    """Print the survivors and the share noticed; fail if they are not those that are listed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("part", choices=PARTS)
    parser.add_argument("--sample", type=int, default=0, help="sample size (0: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[""], help="only mutants whose printed place starts so")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    subject, all_mutants, survivors = PARTS[arguments.part]
    every = all_mutants()
    chosen = [mutant for mutant in every if str(mutant).startswith(tuple(arguments.only))]
    if arguments.sample:
        chosen = random.Random(arguments.seed).sample(chosen, arguments.sample)
    tally = Tally(every, survivors)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # report the progress however it is stopped
    try:
        for mutant, failure in results_of(subject, chosen, arguments.jobs):
            if mutant:
                tally.add(mutant, failure)
            elif failure:
                tally.wrong.append(f"fails without a change: {failure}")
    except KeyboardInterrupt:
        tally.wrong.append(f"stopped after {tally.counts.total()} of {len(chosen)} mutants")
    for line in tally.wrong:
        print(line)
    kinds = ", ".join(f"{number} {kind}" for kind, number in tally.counts.items())
    print(f"{tally.counts.total()} mutants: {kinds}; {tally.share():.1%} of those not equivalent noticed")
    return int(bool(tally.wrong) or (len(chosen) == len(every) and tally.share() < MIN_SHARE))


if __name__ == "__main__":
    sys.exit(main())
