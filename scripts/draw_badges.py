"""Draw the README's badges into docs/images/badges/ from what the repository says about itself.

Run `make reference` after a change. `--check` only reports which are stale.
"""

import argparse
import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "images" / "badges"
LETTER_PX, MARGIN_PX = 6.6, 8
GREEN, BLUE, GREY = "#2e7d32", "#1f6feb", "#57606a"


def badges() -> dict[str, str]:
    """Return the badges by file name."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    version = _found("host/thumper/common/version.py", r'__version__ = "(.+)"')
    python = project["project"]["requires-python"].removeprefix(">=")
    flash_kB = int(_found("firmware/Makefile", r"FLASH_BUDGET = (\d+)")) / 1024
    licence = _found("LICENSE", r"(\w+) License")
    return {
        "version.svg": badge("version", version, BLUE),
        "licence.svg": badge("licence", licence, BLUE),
        "python.svg": badge("Python", f"{python} or newer", BLUE),
        "firmware.svg": badge("firmware", f"≤ {flash_kB:.0f} KiB of flash", GREEN),
        "robots.svg": badge("real robots", "none yet", GREY),
    }


def badge(name: str, value: str, colour: str) -> str:
    """Return a picture of two fields side by side."""
    left, right = (round(LETTER_PX * len(text) + 2 * MARGIN_PX) for text in (name, value))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + right}" height="20" role="img" '
        f'aria-label="{name}: {value}">'
        f'<rect width="{left + right}" height="20" rx="4" fill="#24292f"/>'
        f'<path d="M{left} 0h{right - 4}a4 4 0 0 1 4 4v12a4 4 0 0 1-4 4H{left}z" fill="{colour}"/>'
        '<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11" text-anchor="middle">'
        f'<text x="{left / 2}" y="14">{name}</text><text x="{left + right / 2}" y="14">{value}</text>'
        "</g></svg>\n"
    )


def _found(path: str, pattern: str) -> str:
    match = re.search(pattern, (ROOT / path).read_text(encoding="utf-8"))
    assert match is not None, f"{path}: no {pattern}"
    return match[1]


def main() -> int:
    """Write the badges, or check them; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="exit with 1 if a badge is stale")
    check = parser.parse_args().check
    stale = 0
    for name, picture in badges().items():
        path = FOLDER / name
        if path.exists() and path.read_text(encoding="utf-8") == picture:
            continue
        stale += 1
        if check:
            print(f"stale: {path.relative_to(ROOT)}; run `make reference`")
        else:
            path.parent.mkdir(exist_ok=True)
            path.write_text(picture, encoding="utf-8")
            print(f"wrote {path.relative_to(ROOT)}")
    return int(check and stale > 0)


if __name__ == "__main__":
    raise SystemExit(main())
