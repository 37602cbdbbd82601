"""Finish the pages of the built site: formulas as MathML, options in one line, the address in `git clone`.

Run: python scripts/finish_pages.py SITE [REPOSITORY] (part of `make docs`). With the repository's address,
`git clone URL` becomes a command that can be copied, and the comment that explains URL goes. A formula is a
```math block that begins with \\begin{...}. The generator of the site knows no such language and writes plain
text; GitHub draws it. A browser breaks a line after any hyphen, so `--out` became `-` and `-out` on a phone.
In a narrow cell of a table it broke names anywhere; now it breaks them after a slash or an underscore.
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
CELL = re.compile(r"<td[ >].*?</td>", re.DOTALL)
BETWEEN_PARTS = re.compile(r"(?<=\w[/_])(?=[\w.])(?![^<]*>)")
URL_COMMENT = re.compile(r'<span id="[^"]*"><a [^>]*></a> *<span class="c1"># URL: [^<]*</span>\n</span>')
URL = re.compile(r'(clone<span class="w"> </span>)URL')
OPTION = re.compile(r"(?<![\w&;-])--?[a-z][\w-]*(?![^<]*>)")


def mathml(latex: str, *, block: bool) -> str:
    """Return a formula as MathML: on lines of its own, or within a line."""
    formula = convert(latex, display="block" if block else "inline")
    return f"\n<div>{formula}</div>\n" if block else f"<span>{formula}</span>"


def finished(page: str, repository: str = "") -> str:
    """Return a page of the site with formulas drawn and options marked, which its style keeps in one line."""
    if repository:
        page = URL.sub(rf"\g<1>{repository}", URL_COMMENT.sub("", page))
    page = CELL.sub(lambda cell: CODE.sub(lambda code: BETWEEN_PARTS.sub("<wbr>", code[0]), cell[0]), page)
    return CODE.sub(
        lambda code: OPTION.sub(r'<span class="option">\g<0></span>', code[0]), BLOCK.sub(_drawn, page)
    )


def _drawn(block: re.Match[str]) -> str:
    text = unescape(TAG.sub("", block[1])).strip()
    return mathml(text, block=True) if text.startswith(r"\begin{") else block[0]


def main(site: Path, repository: str = "") -> None:
    """Rewrite all pages."""
    for path in site.rglob("*.html"):
        path.write_text(finished(path.read_text(encoding="utf-8"), repository), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:3])
