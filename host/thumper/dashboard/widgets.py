"""NiceGUI elements of the page."""

from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.element import Element

STATIC = Path(__file__).parent / "static"


class Widget(Element, component="widget.js", esm={"thumper-dashboard": str(STATIC)}):
    """An element that `static/index.js` fills with the widget `name`."""

    def __init__(self, name: str, options: dict[str, Any] | None = None) -> None:
        super().__init__()
        self._props["name"] = name
        self._props["options"] = options or {}


def box(classes: str) -> ui.element:
    """Add a container."""
    return ui.element("div").classes(classes)


def inline(content: str) -> ui.html:
    """Add trusted HTML without a box of its own (CSS `display: contents`)."""
    return ui.html(content, sanitize=False).classes("tp-inline")


def button(classes: str, data: dict[str, str] | None = None, title: str = "") -> ui.element:
    """Add a plain button; `data` are the attributes that `static/` reacts to."""
    element = ui.element("button").classes(classes)
    element._props["type"] = "button"
    element._props.update(data or {})
    if title:
        element._props.update({"title": title, "aria-label": title})
    return element
