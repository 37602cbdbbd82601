"""Finish the pages of the built site: draw formulas as MathML, and keep each option of a command in one line.

Run: python scripts/finish_pages.py SITE (part of `make docs`). A formula is a ```math block that begins with
\\begin{...}. The generator of the site knows no such language and writes plain text; GitHub draws it.
A browser breaks a line after any hyphen, so `--out` became `-` and `-out` on a phone.
"""

import re
import sys
from html import unescape
from pathlib import Path

from latex2mathml.converter import convert

BLOCK = re.compile(
    r'<div class="language-text [^"]*">(?:(?!</div>).)*?<code>(.*?)</code></pre></div>', re.DOTALL
)
TAG = re.compile(r"<[^>]*>")
CODE = re.compile(r"<code[ >].*?</code>", re.DOTALL)
OPTION = re.compile(r"(?<![\w&;-])--?[a-z][\w-]*(?![^<]*>)")


def mathml(latex: str, *, block: bool) -> str:
    """Return a formula as MathML: on lines of its own, or within a line."""
    formula = convert(latex, display="block" if block else "inline")
    return f"\n<div>{formula}</div>\n" if block else f"<span>{formula}</span>"


def finished(page: str) -> str:
    """Return a page of the site with formulas drawn and options marked, which its style keeps in one line."""
    return CODE.sub(
        lambda code: OPTION.sub(r'<span class="option">\g<0></span>', code[0]), BLOCK.sub(_drawn, page)
    )


def _drawn(block: re.Match[str]) -> str:
    text = unescape(TAG.sub("", block[1])).strip()
    return mathml(text, block=True) if text.startswith(r"\begin{") else block[0]


def main(site: Path) -> None:
    """Rewrite all pages."""
    for path in site.rglob("*.html"):
        path.write_text(finished(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
