"""Our own parts of the page, as NiceGUI elements."""

from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.element import Element

STATIC = Path(__file__).parent / "static"


class Part(Element, component="widget.js", esm={"thumper-dashboard": str(STATIC)}):
    """A place where `static/index.js` puts one of its parts."""

    def __init__(self, name: str, options: dict[str, Any] | None = None) -> None:
        super().__init__()
        self._props["name"] = name
        self._props["options"] = options or {}


def box(classes: str) -> ui.element:
    """A place for others."""
    return ui.element("div").classes(classes)


def inline(content: str) -> ui.html:
    """HTML of our own, as if it stood in its parent."""
    return ui.html(content, sanitize=False).classes("tp-inline")


def button(classes: str, data: dict[str, str] | None = None, title: str = "") -> ui.element:
    """A plain button; `data` are attributes that `static/` looks for."""
    made = ui.element("button").classes(classes)
    made._props["type"] = "button"
    made._props.update(data or {})
    if title:
        made._props.update({"title": title, "aria-label": title})
    return made
