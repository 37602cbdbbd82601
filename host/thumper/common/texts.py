"""Texts from outside that appear in answers and logs, and hints for names that are mistyped."""

from collections.abc import Collection

MAX_CHARACTERS = 300
MIN_SIMILARITY = 0.6  # of difflib: 1.0 for equal names
SHORT = 5  # letters; a name as short resembles only those with one letter more or less, or that it begins


def shortened(text: str) -> str:
    """Return the text on one line, at most 300 characters, without control characters."""
    line = "".join(character if character.isprintable() else "?" for character in text[: MAX_CHARACTERS + 1])
    return line if len(line) <= MAX_CHARACTERS else line[: MAX_CHARACTERS - 1] + "…"


def close_names(name: str, names: Collection[str]) -> list[str]:
    """Return the names that resemble a mistyped name, at most two, the best first."""
    from difflib import get_close_matches  # only for errors: the import takes 3 ms

    alike = [
        known
        for known in names
        if len(name) > SHORT or abs(len(known) - len(name)) <= 1 or known.startswith(name)
    ]
    return get_close_matches(name, alike, n=2, cutoff=MIN_SIMILARITY)


def choice_hint(name: str, names: Collection[str]) -> str:
    """Return the fix for an unknown name: the name that was meant, else all names."""
    close = close_names(name, names)
    return f"did you mean {close[0]!r}?" if close else f"choose from: {', '.join(names)}"


def place_text(x_m: float, y_m: float) -> str:
    """Return a place as text, without the sign of a rounded zero."""
    return f"({x_m:z.2f}, {y_m:z.2f})"


def is_number(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
