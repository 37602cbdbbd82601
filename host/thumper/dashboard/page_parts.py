"""Our own parts of the page, as NiceGUI elements."""

from pathlib import Path
from typing import Any

from nicegui.element import Element

STATIC = Path(__file__).parent / "static"


class Part(Element, component="part.js", esm={"thumper-dashboard": str(STATIC)}):
    """A place where `static/index.js` puts one of its parts."""

    def __init__(self, name: str, options: dict[str, Any] | None = None) -> None:
        super().__init__()
        self._props["name"] = name
        self._props["options"] = options or {}
