"""NiceGUI elements of the page."""

import json
from pathlib import Path
from typing import Any

from nicegui import ui
from nicegui.element import Element

from thumper.common.colours import GREEN, RED

STATIC = Path(__file__).parent / "static"
LOADING = """<div id="tp-loading" role="status"><b>Thumper</b>Loading the dashboard …</div>
<style>
  #tp-loading { position: fixed; inset: 0; z-index: 9000; display: grid; place-content: center; gap: 8px;
    text-align: center; font: 16px/1.5 system-ui, sans-serif; background: #f3f5f8; color: #5a6876; }
  #tp-loading b { font-size: 24px; color: #16202b; }
  @media (prefers-color-scheme: dark) {
    #tp-loading { background: #0d141b; color: #94a3b2; }
    #tp-loading b { color: #e6edf3; }
  }
</style>"""
# The browser finds a module only after it has read the one that imports it; name all of them at once.
PRELOAD = """<script type="module">
  for (const name of %s) {
    const href = new URL(name, import.meta.resolve("thumper-dashboard")).href;
    document.head.append(Object.assign(document.createElement("link"), { rel: "modulepreload", href }));
  }
</script>"""


class Widget(Element, component="widget.js", esm={"thumper-dashboard": str(STATIC)}):
    """An element that `static/index.js` fills with the widget `name`."""

    def __init__(self, name: str, options: dict[str, Any] | None = None) -> None:
        super().__init__()
        self._props["name"] = name
        self._props["options"] = options or {}


def begin_page(*sheets: str) -> ui.dark_mode:
    """Set a page's colours and style sheets; return its scheme, which follows the system.

    It shows at once that the page loads; `static/index.js` removes that.
    """
    ui.colors(primary="var(--tp-accent)", negative=RED, positive=GREEN, dark="#18222d", dark_page="#0f1720")
    ui.add_body_html(LOADING)
    ui.add_head_html(PRELOAD % json.dumps(sorted(path.name for path in STATIC.glob("*.js"))))
    for sheet in sheets:
        ui.add_css(STATIC / sheet)
    dark = ui.dark_mode(value=None)
    ui.query(".nicegui-content").classes("tp-content")
    return dark


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
