"""Lower some pages in the search of the built site: a heading there counts as text, not as a title.

Run: python scripts/search_weights.py SITE (part of `make docs`). The search puts titles before texts and
knows no weights of pages, so 'Docking' of the results would come before the guide 'Dock at a charger', and
'Battery' of the simulator's model before what to do with an empty one.
"""

import json
import re
import sys
from pathlib import Path

LOW = ("results/", "notebooks/", "explanation/simulator.")
JOINER = "\u2060"  # invisible; a word that contains it is another word to the search
TAG_OR_START = re.compile(r"<[^>]*>|&\w+;|\b(\w)(?=\w)")


def lowered(index: dict[str, list[dict[str, str]]]) -> None:
    """Hide the titles of low pages from the search, and repeat their words at the end of the text."""
    for item in index["items"]:
        if item["location"].startswith(LOW) and JOINER not in item["title"]:
            item["text"] += f"<p>{item['title']}</p>"
            item["title"] = TAG_OR_START.sub(lambda found: found[0] + JOINER * bool(found[1]), item["title"])


def main(site: Path) -> None:
    """Rewrite `search.json` and its copy for pages that are opened as files."""
    path = site / "search.json"
    index = json.loads(path.read_text(encoding="utf-8"))
    lowered(index)
    text = json.dumps(index, ensure_ascii=False, separators=(",", ":"))
    path.write_text(text, encoding="utf-8")
    script = site / "search.js"
    if script.exists():
        script.write_text(f"var __index = {text};", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
