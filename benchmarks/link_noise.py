"""Send a million requests, three quarters of them damaged, over the simulated line to the built ELF."""

import argparse
import sys
from itertools import zip_longest
from pathlib import Path

from thumper_hil.bench import DEFAULT_ELF
from thumper_hil.chip.chip import CPU_HZ, Chip
from thumper_hil.chip.link_noise import send_damaged_requests

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

FRAMES = 1_000_000


def main() -> None:
    """Send the requests and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=FRAMES)
    chip = Chip(DEFAULT_ELF)
    chip.run(CPU_HZ // 10)
    chip.receive(chip.available)
    result = send_damaged_requests(chip, frames=parser.parse_args().frames, seed=7)
    print(f"requests sent                        {result.frames}")
    print(f"valid for the host's decoder         {result.valid}")
    print(f"answers expected, received, equal    {len(result.expected)}, {len(result.answers)}, ", end="")
    print("yes" if result.answers == result.expected else "NO")
    print(f"damaged or unknown, host's count     {result.expected_errors} = ", end="")
    print(f"{result.expected_errors % 2**16} modulo 2^16; board's count {result.counted_errors}")
    print(f"invalid frames from the board        {result.host_errors}")
    print(f"simulated time                       {chip.time_s:.0f} s, {chip.resets} resets")
    wrong = sum(due != given for due, given in zip_longest(result.expected, result.answers))
    figure(f"wrong answers to {result.frames} requests, most damaged", str(wrong), aim="0")
    figure("resets during these requests", str(chip.resets), aim="0")


if __name__ == "__main__":
    main()
