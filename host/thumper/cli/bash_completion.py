"""Complete words with `:` and `=` in bash, which splits them there: `sim://?world=lab` is five words to it.

Typer gets the whole words, and bash only the part of an answer that it replaces.
"""

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout

INSTRUCTION, WORDS, CURRENT = "_THUMPER_COMPLETE", "COMP_WORDS", "COMP_CWORD"
BREAKS = ":="  # those of COMP_WORDBREAKS that a port or an option contains


def whole_words(words: list[str], current: int) -> tuple[list[str], int]:
    """Return the words up to the current one, joined where bash split them, and how much of it bash keeps."""
    joined = [""]
    for index, word in enumerate(words[: current + 1]):
        is_break = index > 0 and bool(word) and not word.strip(BREAKS)
        after_break = bool(joined[-1]) and joined[-1][-1] in BREAKS
        if index == 0 or is_break or after_break:
            joined[-1] += word
        else:
            joined.append(word)
    last = joined[-1]
    typed = last.partition("=")[2] if last.startswith("-") else last
    replaced = words[current].lstrip(BREAKS)  # bash leaves a word in quotes whole
    return joined, max(0, len(typed) - len(replaced))


@contextmanager
def in_bash() -> Iterator[None]:
    """Answer a request of Typer's bash script within; do nothing in any other start of the program."""
    words = os.environ.get(WORDS, "").split("\n")  # as the script joins them
    current = int(os.environ.get(CURRENT, "0"))
    if os.environ.get(INSTRUCTION) != "complete_bash" or current >= len(words):
        yield
        return
    joined, kept = whole_words(words, current)
    os.environ |= {WORDS: "\n".join(joined), CURRENT: str(len(joined) - 1)}
    answers = io.StringIO()
    try:
        with redirect_stdout(answers):
            yield
    finally:
        sys.stdout.writelines(f"{line[kept:]}\n" for line in answers.getvalue().splitlines())
