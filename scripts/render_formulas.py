"""Draw the formulas of the built site as MathML, which browsers draw without a script.

Run: python scripts/render_formulas.py SITE (part of `make docs`). A formula is a ```math block that begins
with \\begin{...}. The generator of the site knows no such language and writes plain text; GitHub draws it.
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


def mathml(latex: str, *, block: bool) -> str:
    """Return a formula as MathML: on lines of its own, or within a line."""
    formula = convert(latex, display="block" if block else "inline")
    return f"\n<div>{formula}</div>\n" if block else f"<span>{formula}</span>"


def rendered(page: str) -> str:
    """Return a page of the site with its formulas drawn."""
    return BLOCK.sub(_drawn, page)


def _drawn(block: re.Match[str]) -> str:
    text = unescape(TAG.sub("", block[1])).strip()
    return mathml(text, block=True) if text.startswith(r"\begin{") else block[0]


def main(site: Path) -> None:
    """Rewrite the pages that have formulas."""
    for path in site.rglob("*.html"):
        page = path.read_text(encoding="utf-8")
        if r"\begin{" in page:
            path.write_text(rendered(page), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
