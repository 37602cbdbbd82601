"""The built documentation: lists and numbers as written, drawings without collisions, copy, search."""

import html
import io
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Browser, expect

from tests.page_checks import POOR
from tests.variants import some_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
DRAWINGS = sorted(path.name for path in (DOCS / "images").glob("*.svg") if "<text" in path.read_text())
SOURCES = [page.relative_to(DOCS).with_suffix("") for page in DOCS.rglob("*.md") if page.name != "README.md"]
PAGES = sorted((page.as_posix() for page in SOURCES), reverse=True)
COMMAND = re.compile(r"(thumper [a-z]|make |pytest |sudo |git |pip |cd |source |\.venv/)")
LONGEST_COMMENT = 43  # characters of code in a line of 360 px
CLEAR_PX = 6
QUIET = "reference/glossary.html"  # the front page keeps a core busy with its robot
FENCE = re.compile(r"^ *```.*?^ *```$", re.DOTALL | re.MULTILINE)

COLLISIONS = """(clear_px) => {
  const name = (text) => text.textContent.trim();
  const box = (node, by = 0) => {
    const { left, right, top, bottom } = node.getBoundingClientRect();
    return { left: left - by, right: right + by, top, bottom };
  };
  const inside = (a, b) => a.left >= b.left && a.right <= b.right && a.top >= b.top && a.bottom <= b.bottom;
  const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const all = (kind) => [...document.querySelectorAll(`${kind}:not(defs *)`)], found = [];
  const points = all("path").flatMap((path) => {
    const matrix = path.getScreenCTM(), length = path.getTotalLength();
    const over = all("rect").filter((rect) => path.compareDocumentPosition(rect) & 4);
    return Array.from({ length: Math.ceil(length / 2) + 1 }, (_, i) => {
      const { x, y } = path.getPointAtLength(Math.min(2 * i, length)).matrixTransform(matrix);
      return { left: x, right: x, top: y, bottom: y };
    }).filter((point) => !over.some((rect) => inside(point, box(rect))));
  });
  all("text").forEach((text, i, texts) => {
    const mine = box(text), wide = box(text, clear_px);
    for (const other of texts.slice(i + 1))
      if (name(other) && meet(wide, box(other))) found.push(`${name(text)} meets ${name(other)}`);
    for (const rect of all("rect"))  // clear of an edge: all inside, or all outside
      if (meet(wide, box(rect)) && !inside(wide, box(rect))) found.push(`${name(text)} meets an edge`);
    if (points.some((point) => inside(point, mine)))
      found.push(`${name(text)} meets a line`);
  });
  return found;
}"""
"""Texts less than `clear_px` beside a text or a box's edge, or on a line that is not under a box."""


BROKEN_WORDS = """() => [...document.querySelectorAll("article td code")].flatMap((code) => {
  const texts = document.createTreeWalker(code, 4), found = [], range = document.createRange();
  for (let text; (text = texts.nextNode()); )
    for (let i = 1; i < text.length; i++) {
      range.setStart(text, i - 1), range.setEnd(text, i + 1);
      const tops = [...range.getClientRects()].map((one) => one.top);
      const broken = Math.max(...tops) - Math.min(...tops) > 6;
      if (broken && /\\w\\w/.test(range.toString())) found.push(code.innerText);
    }
  return found;
})"""
"""Names and paths in tables that a line breaks between two letters."""


class Lists(HTMLParser):
    """Collects the numbers of ordered items and counts the others, in a page's article."""

    def __init__(self) -> None:
        super().__init__()
        self.numbers: list[int] = []
        self.bullets = 0
        self._open: list[int | None] = []
        self._in_article = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "article":
            self._in_article = True
        elif tag in {"ol", "ul"}:
            self._open.append(int(dict(attrs).get("start") or 1) if tag == "ol" else None)
        elif tag == "li" and self._in_article:
            number = self._open[-1]
            if number is None:
                self.bullets += 1
            else:
                self.numbers.append(number)
                self._open[-1] = number + 1

    def handle_endtag(self, tag: str) -> None:
        if tag == "article":
            self._in_article = False
        elif tag in {"ol", "ul"}:
            self._open.pop()


def built(page: Path, pages: Path) -> Path:
    """Return the file that a source page becomes."""
    file = pages / page.relative_to(DOCS).with_suffix(".html")
    return file.with_name("index.html") if page.name == "README.md" else file


def test_lists_show_every_item_with_the_number_that_is_written(pages: Path) -> None:
    for page in sorted(DOCS.rglob("*.md")):
        source = FENCE.sub("", page.read_text(encoding="utf-8"))
        lists = Lists()
        lists.feed(built(page, pages).read_text(encoding="utf-8"))
        assert lists.numbers == [int(one) for one in re.findall(r"^ *(\d+)\. ", source, re.MULTILINE)], page
        assert lists.bullets == len(re.findall(r"^ *[-*] ", source, re.MULTILINE)), page


def test_commands_are_marked_as_such() -> None:
    """Only blocks of `sh` and `console` have a button that copies them."""
    for page in sorted(DOCS.rglob("*.md")):
        text = page.read_text(encoding="utf-8")
        indented = re.findall(r"\n\n {4,}(.*)", re.sub(FENCE, "", text))
        plain = re.findall(r"^ *```(?:text)?\n(.*)", text, re.MULTILINE)
        assert not [line for line in indented + plain if COMMAND.match(line)], page
        for block in re.findall(r"^ *```console\n(.*?)```", text, re.DOTALL | re.MULTILINE):
            assert block.lstrip().startswith("$ "), page


@pytest.mark.parametrize("name", DRAWINGS)
def test_labels_of_a_drawing_touch_nothing(browser: Browser, name: str) -> None:
    page = browser.new_page()
    page.set_content((DOCS / "images" / name).read_text(encoding="utf-8"))
    assert page.locator("text").count() > 5
    assert page.evaluate(COLLISIONS, CLEAR_PX) == []
    page.close()


def test_wiring_shows_the_resistor_before_pin_d13(browser: Browser) -> None:
    page = browser.new_page()
    page.set_content((DOCS / "images/wiring.svg").read_text(encoding="utf-8"))
    resistor, pin = (page.get_by_text(text, exact=True).bounding_box() for text in ("1 kΩ", "D13"))
    assert resistor is not None
    assert pin is not None
    assert abs(resistor["y"] - pin["y"]) < 2
    assert resistor["x"] > pin["x"] + pin["width"]
    page.close()


def test_button_of_a_transcript_copies_its_commands_only(browser: Browser, pages: Path) -> None:
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto((pages / "howto/flashing.html").as_uri())
    block = page.locator(".language-console").first
    expect(block).to_contain_text("written and verified")
    block.hover()
    block.get_by_role("button").first.click()
    page.wait_for_function("async () => (await navigator.clipboard.readText()).length > 0")
    lines = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert [line.partition(" #")[0].rstrip() for line in lines] == [
        "make firmware",
        "thumper flash --board /dev/ttyUSB0",
    ]
    context.close()


def test_search_finds_what_to_do_with_a_lost_robot_without_a_server(browser: Browser, site: Path) -> None:
    context = browser.new_context()
    context.set_offline(True)
    page = context.new_page()
    page.goto((site / QUIET).as_uri())
    page.get_by_role("button", name="Search").first.click()
    page.keyboard.type("lost robot", delay=50)
    first = page.locator("a[href*='h=lost']").first
    expect(first).to_contain_text("A lost robot")
    expect(first).to_have_attribute("href", re.compile(r"operate\.html\?h=lost\+robot#a-lost-robot$"))
    context.close()


@pytest.mark.parametrize(
    ("words", "href"),
    some_of(
        [
            ("docking", r"howto/docking\.html"),
            ("robot does not move", r"howto/troubleshooting\.html.*#the-robot-does-not-move$"),
            ("lidar not found", r"howto/troubleshooting\.html.*#lidar-not-found$"),
            ("how do I map a room", r"tutorials/map\.html"),
            ("battery", r"howto/\w+\.html.*battery"),
            ("what is a costmap", r"explanation/navigation\.html.*#what-a-costmap-is$"),
        ],
        fast=2,
    ),
)
def test_search_puts_guides_before_results(browser: Browser, site: Path, words: str, href: str) -> None:
    context = browser.new_context()
    page = context.new_page()
    page.goto((site / QUIET).as_uri())
    page.get_by_role("button", name="Search").first.click()
    page.keyboard.type(words, delay=50)
    expect(page.locator("a[href*='?h=']").first).to_have_attribute("href", re.compile(href))
    context.close()


@pytest.mark.parametrize("name", ["reference/cli/drive.html", "reference/options.html", "reference/bus.html"])
def test_descriptions_of_tables_are_on_the_screen_of_a_phone(
    browser: Browser, pages: Path, name: str
) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / name).as_uri())
    hidden = page.evaluate("""() => [...document.querySelectorAll("article td:last-child")]
      .filter((cell) => cell.parentElement.cells.length === 4 && cell.getBoundingClientRect().right > 390)
      .map((cell) => cell.innerText)""")
    assert hidden == []
    page.close()


def test_rows_for_users_of_ros_are_stacked_on_a_phone(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / "explanation/from-ros.html").as_uri())
    table = page.locator("article table").first
    expect(table.locator("thead")).to_be_hidden()
    lefts = table.locator("td").evaluate_all("(all) => all.map((one) => one.getBoundingClientRect().left)")
    assert len(set(lefts)) == 1
    assert table.evaluate("(one) => one.getBoundingClientRect().right") <= 390
    page.close()


def test_code_in_one_name_does_not_stack_a_table_of_figures(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / "results/mapping.html").as_uri())
    heads = page.locator("article table").first.locator("th")
    tops = heads.evaluate_all("(all) => all.map((one) => one.getBoundingClientRect().top)")
    assert len(tops) == 4
    assert len(set(tops)) == 1
    page.close()


@pytest.mark.parametrize("width", some_of([390, 1440, 1024], 2))
def test_first_page_fits_the_window_and_its_buttons_lead_on(
    browser: Browser, pages: Path, width: int
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto((pages / "index.html").as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    buttons = page.locator(".hero .md-button")
    expect(buttons).to_have_count(3)
    for button in buttons.all():
        expect(button).to_be_in_viewport(ratio=1)
        target = (button.get_attribute("href") or "").removeprefix("index.html")
        assert page.locator(target).count() == 1 if target.startswith("#") else (pages / target).exists()
    robot = page.locator("#robot").bounding_box()
    assert robot is not None
    assert width < 1024 or robot["y"] < 700
    page.close()


def test_page_not_found_leads_to_the_start_and_to_troubleshooting(pages: Path) -> None:
    article = (pages / "404.html").read_text(encoding="utf-8").partition("<article")[2]
    links = re.findall(r"<p>.*?</p>", article, re.DOTALL)[0]
    targets = re.findall(r'href="/([^"]+)"', links)
    assert targets == ["index.html", "howto/troubleshooting.html"]
    assert all((pages / target).exists() for target in targets)


def test_each_page_is_described_by_its_own_heading_and_first_paragraph(pages: Path) -> None:
    """For the browser's tab, search engines, and previews where a link is sent."""
    seen: dict[str, str] = {}
    for page in sorted(DOCS.rglob("*.md")):
        text = html.unescape(built(page, pages).read_text(encoding="utf-8"))
        head, _, body = text.partition("</head>")
        heading = re.sub(r"<[^>]*>", "", re.findall(r"<h1[^>]*>(.*?)(?:<a class|</h1>)", body, re.DOTALL)[0])
        assert heading.strip() in re.findall(r'og:title" content="([^>]*)">', head), page
        assert f"<title>{heading.strip()}" in head, page
        (words,) = re.findall(r'name="description" content="([^>]*)">', head)
        assert len(words) > 20, page
        assert re.findall(r'og:description" content="([^>]*)">', head) == [words], page
        if page.parent.name != "benchmarks":  # made by one program from one sentence
            assert seen.setdefault(words, page.name) == page.name


def test_links_buttons_and_the_robot_share_one_accent(browser: Browser, site: Path) -> None:
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto((site / "index.html").as_uri())
        colours = page.evaluate(
            """() => [[".hero p a:not(.md-button)", "color"], [".md-button--primary", "backgroundColor"],
              [".robot-stick i", "backgroundColor"], [".robot-gains input", "accentColor"]]
              .map(([one, what]) => getComputedStyle(document.querySelector(one))[what])"""
        )
        assert len(set(colours)) == 1, (scheme, colours)
        page.close()


def test_clone_command_of_a_published_site_has_its_address(pages: Path, tmp_path: Path) -> None:
    for name in ("index", "howto/install"):
        shutil.copy(pages / f"{name}.html", tmp_path)
    address = "https://github.com/owner/name"
    subprocess.run([sys.executable, ROOT / "scripts/finish_pages.py", tmp_path, address], check=True)
    for page in tmp_path.glob("*.html"):
        text = html.unescape(re.sub(r"<[^>]*>", "", page.read_text(encoding="utf-8")))
        assert f"git clone {address} thumper && cd thumper" in text, page.name
        assert "# URL" not in text


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(
    "name", some_of(["index.html", "notebooks/odometry.html", "results/navigation.html"])
)
def test_text_and_pictures_can_be_read(browser: Browser, site: Path, name: str, scheme: str) -> None:
    """In the dark scheme drawings and charts are dark, too; the dashboard has a picture of its own for it.

    The paragraph signs appear under the pointer.
    """
    page = browser.new_page(viewport={"width": 1440, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
    page.goto((site / name).as_uri())
    poor = [line for line in page.evaluate(POOR) if not line.startswith(("¶", "no name"))]
    assert poor == []
    drawings = "\"article img:not([src*='dashboard'])\""
    filters = page.evaluate(
        f"[...document.querySelectorAll({drawings})].map((i) => getComputedStyle(i).filter)"
    )
    assert filters
    assert {text.startswith("invert(1)") for text in filters} == {scheme == "dark"}
    # "screen" gives a black ground the colour of the page
    blends = page.evaluate(
        f"[...document.querySelectorAll({drawings})].map((i) => getComputedStyle(i).mixBlendMode)"
    )
    assert set(blends) == {"screen" if scheme == "dark" else "normal"}
    page.close()


@pytest.mark.parametrize("name", some_of(PAGES, fast=4))
def test_no_page_scrolls_sideways_on_a_phone(browser: Browser, pages: Path, name: str) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844}, is_mobile=True)
    page.goto((pages / f"{name}.html").as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    page.close()


@pytest.mark.parametrize("name", ["tutorials/build", "explanation/architecture"])
def test_labels_of_wide_drawings_can_be_read_on_a_phone(browser: Browser, pages: Path, name: str) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844}, is_mobile=True)
    page.goto((pages / f"{name}.html").as_uri())
    for drawing in page.locator("article p > img[src$='.svg']").all():
        assert drawing.evaluate("(one) => one.offsetWidth") >= 800
        assert drawing.evaluate("(one) => one.parentElement.offsetWidth") <= 390
    page.close()


@pytest.mark.parametrize(
    ("name", "width"),
    [("reference/cli/drive", 390), ("explanation/architecture", 1440)],
)
def test_names_in_tables_do_not_break(browser: Browser, pages: Path, name: str, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto((pages / f"{name}.html").as_uri())
    names = page.locator("article table").first.locator("td > code").all()
    assert len(names) >= 3
    for one in names:
        assert one.evaluate("(one) => one.getClientRects().length") == 1, one.inner_text()
    page.close()


def test_formulas_of_the_control_law_are_drawn(browser: Browser, pages: Path) -> None:
    page = browser.new_page()
    page.goto((pages / "explanation/control-law.html").as_uri())
    rows = page.locator("math mtr").all_text_contents()
    assert len(rows) == 9
    assert not [row for row in rows if "\\" in row or "&" in row]
    assert "begin{" not in page.locator("article").inner_text()
    page.close()


def test_wide_table_has_a_shadow_where_columns_are_hidden(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / "results/navigation.html").as_uri())
    page.add_style_tag(content=".md-header, .md-sidebar-button { display: none }")
    table = page.locator("h2#barn ~ .md-typeset__scrollwrap").first
    table.scroll_into_view_if_needed()
    box = table.bounding_box()
    assert box is not None
    strip = {"x": box["x"] + box["width"] - 6, "y": box["y"] + box["height"] - 12, "width": 6, "height": 8}

    def darkest() -> int:
        picture = Image.open(io.BytesIO(page.screenshot(clip=strip))).convert("L")  # type: ignore[arg-type]
        return int(picture.getextrema()[0])  # type: ignore[arg-type]

    assert darkest() < 240
    table.evaluate("(one) => (one.scrollLeft = one.scrollWidth)")
    assert darkest() > 250
    page.close()


def test_button_of_the_contents_goes_on_the_way_down_a_phone(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / "results/navigation.html").as_uri())
    button = page.locator(".md-sidebar-button")
    page.mouse.move(195, 400)
    expect(button).to_be_visible()
    page.mouse.wheel(0, 900)
    expect(button).to_be_hidden()
    page.mouse.wheel(0, -200)
    expect(button).to_be_visible()
    page.close()


def test_code_fits_a_wide_window_and_wraps_on_a_phone(browser: Browser, pages: Path) -> None:
    cut = """() => [...document.querySelectorAll("article pre > code")]
      .filter((code) => code.scrollWidth > code.clientWidth).map((code) => code.innerText)"""
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    names = (
        "explanation/navigation",
        "howto/operate",
        "howto/dashboard",
        "reference/config",
        "explanation/firmware",
        "explanation/simulator",
        "howto/python",
        "tutorials/tune",
    )
    for name in names:
        page.goto((pages / f"{name}.html").as_uri())
        for width in (1440, 390):
            page.set_viewport_size({"width": width, "height": 900})
            assert page.evaluate(cut) == [], (name, width)
    page.close()


def test_comments_in_code_fit_a_phone() -> None:
    """A comment that wraps looks like a command; one that scrolls cannot be read beside its line."""
    notebooks = set((DOCS / "notebooks").glob("*.md"))
    for page in [ROOT / "README.md", *sorted(set(DOCS.rglob("*.md")) - notebooks)]:
        for indent, block in re.findall(
            r"^( *)```(?:sh|console|python|toml)\n(.*?)^ *```",
            page.read_text(encoding="utf-8"),
            re.DOTALL | re.MULTILINE,
        ):
            lines = [line.removeprefix(indent) for line in block.splitlines()]
            comments = [line for line in lines if re.search(r"(^|\s)# ", line)]
            assert [line for line in comments if len(line) > LONGEST_COMMENT - len(indent)] == [], page


@pytest.mark.parametrize("name", ["howto/troubleshooting", "explanation/safety", "explanation/slam"])
def test_a_name_in_a_table_breaks_between_its_parts(browser: Browser, pages: Path, name: str) -> None:
    page = browser.new_page(viewport={"width": 375, "height": 844}, is_mobile=True)
    page.goto((pages / f"{name}.html").as_uri())
    assert page.evaluate(BROKEN_WORDS) == []
    page.close()


@pytest.mark.parametrize("name", ["reference/options.html", "reference/cli/drive.html"])
def test_descriptions_of_options_keep_room_for_words_on_a_phone(
    browser: Browser, pages: Path, name: str
) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / name).as_uri())
    widths = page.locator("article td:nth-child(4)").evaluate_all("all => all.map((one) => one.offsetWidth)")
    assert min(widths) >= 200
    page.close()


@pytest.mark.parametrize(
    ("name", "width"),
    [("explanation/safety", 390), ("explanation/security", 390), ("results/navigation", 1440)],
)
def test_tables_fit_their_window(browser: Browser, pages: Path, name: str, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto((pages / f"{name}.html").as_uri())
    cut = page.locator(".md-typeset__scrollwrap").evaluate_all(
        "all => all.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.innerText)"
    )
    assert cut == []
    page.close()


def test_answers_are_wider_than_their_links_on_a_phone(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 900})
    page.goto((pages / "results/mapping.html").as_uri())
    table = page.locator("article table").first
    answer, link = table.locator("td:nth-child(2), td:nth-child(4)").evaluate_all(
        "all => all.slice(0, 2).map((one) => one.offsetWidth)"
    )
    assert answer > link
    page.close()


def test_first_column_stays_while_a_wide_table_scrolls_on_a_phone(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 900})
    page.goto((pages / "results/navigation-history.html").as_uri())
    wide = page.locator(".md-typeset__scrollwrap").filter(has=page.locator("td:nth-child(11)")).first
    first = wide.locator("td").first
    wide.evaluate("(one) => (one.scrollLeft = 200)")
    box = first.bounding_box()
    assert box is not None
    assert box["x"] >= 0
    page.close()


@pytest.mark.parametrize(("name", "width"), [("notebooks/tuning", 1440), ("results/navigation", 390)])
def test_signs_behind_headings_take_no_line(browser: Browser, pages: Path, name: str, width: int) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto((pages / f"{name}.html").as_uri())
    heights = "[...document.querySelectorAll('article :is(h1, h2, h3, h4)')].map((one) => one.offsetHeight)"
    before = page.evaluate(heights)
    page.add_style_tag(content=".headerlink { display: none !important; }")
    assert page.evaluate(heights) == before
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_an_option_of_a_command_stays_in_one_line(browser: Browser, pages: Path) -> None:
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((pages / "tutorials/map.html").as_uri())
    lines = page.locator("article code .option").evaluate_all(
        "all => all.map((one) => one.getClientRects().length)"
    )
    assert len(lines) > 4
    assert set(lines) <= {0, 1}
    page.close()
