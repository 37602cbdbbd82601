"""Run the notebooks of docs/tutorials and write them, with their outputs, as pages into docs/notebooks.

Run after a change of a notebook (three minutes): .venv/bin/python scripts/render_notebooks.py [NAME ...]
`--check` runs nothing: it reports pages whose text or code differs from their notebook's.
"""

import argparse
import base64
import re
import sys
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from scripts.finish_pages import mathml

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "docs" / "tutorials"
PAGES = ROOT / "docs" / "notebooks"
FORMULA = re.compile(r"\$\$(.+?)\$\$|\$([^$]+)\$", re.DOTALL)
OUTPUT = re.compile(r"\n```text\n.*?\n```\n|\n!\[Output\]\(.*?\)\n", re.DOTALL)
SOLUTION = "<details markdown>\n<summary>Solution</summary>\n\n{block}\n</details>\n"
NOTE = "<!-- Written by scripts/render_notebooks.py from docs/tutorials/{name}.ipynb. -->\n"


def render(notebook: Any, name: str) -> tuple[str, list[bytes]]:
    """Return a notebook as Markdown, and the pictures among its outputs."""
    pictures: list[bytes] = []
    parts = [NOTE.format(name=name)]
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            text = re.sub(r"\]\((\w+)\.ipynb\)", r"](\1.md)", cell.source)
            parts.append(FORMULA.sub(_mathml, text) + "\n")
            continue
        code = "\n".join(line for line in cell.source.splitlines() if not line.startswith("%"))
        block = f"```python\n{code.strip()}\n```\n"
        parts.append(SOLUTION.format(block=block) if "solution" in cell.metadata.get("tags", []) else block)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                pictures.append(base64.b64decode(data["image/png"]))
                parts.append(f"![Output](images/{name}-{len(pictures)}.png)\n")
            elif text := output.get("text", data.get("text/plain", "")).strip("\n"):
                parts.append(f"```text\n{text}\n```\n")
    links = f"[download it](../tutorials/{name}.ipynb), [run it](../index.md#notebooks)"
    parts.insert(2, f"*A notebook with its outputs: {links}.*\n")
    return "\n".join(parts), pictures


def _mathml(match: re.Match[str]) -> str:
    block, inline = match.groups()
    return mathml(block or inline, block=bool(block))


def without_outputs(page: str) -> str:
    """Return a page's text and code."""
    return OUTPUT.sub("", page)


def check(names: list[str]) -> int:
    """Report stale pages; return the exit status."""
    stale = 0
    for name in names:
        fresh, _ = render(nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4), name)  # type: ignore[no-untyped-call]
        page = PAGES / f"{name}.md"
        if not page.exists() or without_outputs(page.read_text(encoding="utf-8")) != without_outputs(fresh):
            stale += 1
            print(f"stale: {page.relative_to(ROOT)}; run scripts/render_notebooks.py {name}")
    return int(stale > 0)


def main() -> int:
    """Write the pages, or check them; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="notebooks; default: all")
    parser.add_argument("--check", action="store_true", help="exit with 1 if a page is stale")
    options = parser.parse_args()
    names = options.names or sorted(path.stem for path in NOTEBOOKS.glob("*.ipynb"))
    if options.check:
        return check(names)
    (PAGES / "images").mkdir(parents=True, exist_ok=True)
    for name in names:
        notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)  # type: ignore[no-untyped-call]
        NotebookClient(notebook, timeout=600, kernel_name="python3", coalesce_streams=True).execute()
        page, pictures = render(notebook, name)
        (PAGES / f"{name}.md").write_text(page, encoding="utf-8")
        for number, picture in enumerate(pictures, 1):
            (PAGES / "images" / f"{name}-{number}.png").write_bytes(picture)
        print(f"wrote docs/notebooks/{name}.md")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
