"""Texts from outside that appear in answers and logs."""

MAX_CHARACTERS = 300


def shortened(text: str) -> str:
    """Return the text on one line, at most 300 characters, without control characters."""
    line = "".join(character if character.isprintable() else "?" for character in text[: MAX_CHARACTERS + 1])
    return line if len(line) <= MAX_CHARACTERS else line[: MAX_CHARACTERS - 1] + "…"
