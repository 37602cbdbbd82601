"""The page in a real browser: what fits on which screen, and what the map explains."""

import itertools
import re

import pytest
from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from playwright.sync_api import Browser, Page, expect

from tests.page_checks import PHONE
from thumper.board.messages import Fault, State
from thumper.common.geometry import Pose2
from thumper.runtime.requests import Query


def test_fault_moves_no_control_and_colours_the_state(page: Page, robot: FakeRobot) -> None:
    for size in ((1440, 900), (1024, 600), (390, 844), (390, 664)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        before = page.locator(".tp-stick").bounding_box()
        robot.fault, robot.fault_words = Fault.STALL_LEFT, "stall left"
        robot.fault_cure = "the left wheels do not turn; are they blocked?"
        expect(page.locator(".tp-fault")).to_be_visible()
        expect(page.locator(".tp-board")).to_have_css("background-color", "rgb(207, 34, 46)")
        assert page.locator(".tp-stick").bounding_box() == before
        page.click("text=Clear fault", trial=True)  # nothing covers it
        robot.reset()
        expect(page.locator(".tp-fault")).to_be_hidden()


CUT = """all => all.filter(
  (one) => one.scrollWidth > one.clientWidth || one.scrollHeight > one.clientHeight
)"""
STALLED = (
    "the left wheels do not turn; are they blocked or on a thick carpet, is a motor or encoder wire loose?"
)


def test_a_fault_is_explained_once_and_blocks_what_needs_none(page: Page, robot: FakeRobot) -> None:
    notices, reason, line = (page.locator(name) for name in (".tp-notice", ".tp-reason", ".tp-state"))
    explore, arm = (page.get_by_role("button", name=name, exact=True) for name in ("Explore", "Arm"))
    expect(explore).not_to_have_attribute("aria-disabled", "true")
    line_before = line.bounding_box()
    robot.fault, robot.fault_words, robot.fault_cure = Fault.STALL_LEFT, "left wheels stalled", STALLED
    robot.reason = f"the board stopped the motors: {STALLED}"
    robot.event(f"not back at the start: the board stopped the motors: {STALLED}")
    robot.event("the map was not saved: disk full")
    expect(page.locator(".tp-fault-cure")).to_have_text(STALLED)
    expect(reason).to_have_text("the board stopped the motors")
    assert line.bounding_box() == line_before
    expect(notices).to_have_text(["the map was not saved: disk full"])
    blocked = "Left wheels stalled: clear the fault first"
    for button in (explore, arm):
        expect(button).to_have_attribute("title", blocked)
        expect(button).to_be_disabled()
    explore.click(force=True)
    expect(notices.last).to_have_text(blocked)
    page.click("text=Clear fault")
    expect(explore).to_be_enabled()
    expect(notices.get_by_text(blocked)).to_have_count(0)
    assert not [query for query in robot.received_of(Query) if query.content.get("command") == "explore"]
    robot.fault, robot.fault_words = Fault.LINK_LOST, "connection lost"
    expect(page.locator(".tp-fault")).to_be_visible()
    expect(arm).to_be_enabled()  # it clears this one


def test_cancel_looks_inactive_while_nothing_runs_but_is_always_sent(page: Page, robot: FakeRobot) -> None:
    cancel = page.locator(".tp-cancel")
    robot.reason = "disarmed"
    expect(cancel).to_be_disabled()
    expect(cancel).to_have_attribute("title", "Nothing is running")
    cancel.click(force=True)
    expect(page.locator(".tp-notice")).to_have_text("done: cancel")
    for reason, experiment, goal in (
        ("waiting, 2 of 3", "", None),
        ("", "tune", None),
        ("", "", Pose2(x_m=1.0, y_m=1.0)),
    ):
        robot.reason, robot.experiment, robot.goal = reason, experiment, goal
        expect(cancel).to_be_enabled()
        robot.reason, robot.experiment, robot.goal = "disarmed", "", None
        expect(cancel).to_be_disabled()


def test_the_status_line_keeps_its_height(page: Page, robot: FakeRobot) -> None:
    for size in ((1440, 900), (1024, 600), (390, 844)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        robot.reason, robot.goal = "", None
        expect(page.locator(".tp-mode")).to_have_text("idle")
        before = page.locator(".tp-state").bounding_box()
        robot.reason, robot.goal = 20 * "a long reason ", Pose2(x_m=1.0, y_m=1.0)
        expect(page.locator(".tp-reason")).to_have_attribute("title", re.compile("long reason"))
        assert page.locator(".tp-state").bounding_box() == before


def test_charts_are_high_on_a_large_screen_and_leave_the_map_its_place(page: Page) -> None:
    for size in ((1440, 900), (1280, 800)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.wait_for_timeout(300)  # the charts follow their boxes
        heights = page.locator(".tp-charts .u-over").evaluate_all("all => all.map((one) => one.clientHeight)")
        assert min(heights) > 110, size
        boxes = [page.locator(name).bounding_box() for name in (".tp-map", ".tp-state", ".tp-wheels")]
        assert all(boxes)
        for above, below in itertools.pairwise(box for box in boxes if box):
            assert above["y"] + above["height"] <= below["y"]
        assert boxes[2] is not None
        assert boxes[2]["y"] + boxes[2]["height"] <= size[1]
        page.locator(".tp-hint details").evaluate("help => help.open = true")
        page.locator("text=manual driving and tuning stop").click(trial=True)  # no scrolling to the last line
        page.click("text=Wheels")
        expect(page.locator(".tp-charts")).to_be_hidden()
        page.click("text=Wheels")
        map_box, wheels_box = (page.locator(name).bounding_box() for name in (".tp-map", ".tp-wheels"))
        page.click(".tp-tab-gains")  # a long panel
        page.wait_for_timeout(300)
        heights = page.locator(".tp-charts .u-over").evaluate_all("all => all.map((one) => one.clientHeight)")
        assert min(heights) > 100, size
        assert page.locator(".tp-map").bounding_box() == map_box
        assert page.locator(".tp-wheels").bounding_box() == wheels_box
        panel, wheels = (page.locator(name).bounding_box() for name in (".tp-panels", ".tp-wheels"))
        assert panel is not None
        assert wheels is not None
        assert panel["y"] + panel["height"] == wheels["y"] + wheels["height"]
        assert page.locator(".tp-charthead").evaluate_all(CUT) == []
        page.click(".tp-tab-drive")


@pytest.mark.parametrize("width", [360, 390])
def test_a_phone_keeps_the_speeds_in_view_beside_gains_and_while_tuning(page: Page, width: int) -> None:
    page.set_viewport_size({"width": width, "height": 844})
    charts = page.locator(".tp-charts > div")
    keys = page.locator(".tp-charts > div:nth-child(-n + 2) .tp-charthead span")
    for tab in ("gains", "tune"):
        page.click(f".tp-tab-{tab}")
        expect(charts.nth(0)).to_be_in_viewport(ratio=1.0)
        expect(charts.nth(1)).to_be_in_viewport(ratio=1.0)
        expect(charts.nth(2)).to_be_hidden()
        tops = keys.evaluate_all("keys => keys.map((key) => key.getBoundingClientRect().top)")
        assert len(tops) == 4
        assert len(set(tops)) == 1  # each legend is one line
    page.click(".tp-tab-gains")
    page.locator("[data-gain=kv]").scroll_into_view_if_needed()
    expect(charts.nth(0)).to_be_in_viewport(ratio=1.0)
    stop, chart = page.locator(".tp-estop").bounding_box(), charts.nth(0).bounding_box()
    assert stop is not None
    assert chart is not None
    assert chart["y"] + chart["height"] < stop["y"] / 2
    page.click(".tp-tab-drive")
    expect(charts.nth(2)).to_be_visible()


def test_a_device_without_a_keyboard_reads_of_no_key(page: Page, browser: Browser, server: Server) -> None:
    page.click(".tp-tab-tune")
    expect(page.locator(".tp-tune p").first).to_contain_text("press Space or Cancel")
    phone = browser.new_page(viewport=PHONE, is_mobile=True, has_touch=True)
    open_page(phone, server)
    phone.click(".tp-tab-tune")
    expect(phone.locator(".tp-tune p").first).to_contain_text("press STOP or Cancel")
    phone.close()


def test_a_notice_on_a_low_screen_is_short_and_covers_no_control(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 1024, "height": 600})
    page.reload()
    robot.reason = "armed"
    expect(page.locator(".tp-reason")).to_have_text("armed; the wheels hold still")
    page.click(".tp-arm")
    page.click("text=Save map")
    notice = page.locator(".tp-notice")
    expect(notice).to_have_text(["done: save_map"])  # the status line has the answer to Arm
    box, state, panels = (
        page.locator(name).bounding_box() for name in (".tp-notice", ".tp-state", ".tp-right")
    )
    assert box is not None
    assert state is not None
    assert panels is not None
    assert box["y"] + box["height"] <= state["y"]
    assert box["x"] + box["width"] <= panels["x"]
    expect(notice).to_have_count(0, timeout=5_500)  # bad ones stay for 6 s


def test_the_box_of_a_fault_folds_up_until_the_next_fault(page: Page, robot: FakeRobot) -> None:
    for width, height in ((1440, 900), (390, 664)):
        page.set_viewport_size({"width": width, "height": height})
        for _ in range(2):
            robot.fault, robot.fault_words = Fault.STALL_LEFT, "stall left"
            robot.fault_cure = "the left wheels do not turn; are they blocked?"
            if width < 500:  # it is folded up at first
                expect(page.locator(".tp-fault-words")).to_be_visible()
                expect(page.locator(".tp-fault-cure")).to_be_hidden()
                page.click(".tp-fault summary")
            expect(page.locator(".tp-fault-cure")).to_be_visible()
            page.click(".tp-fault summary")
            expect(page.locator(".tp-fault-cure")).to_be_hidden()
            box, map_box = page.locator(".tp-fault").bounding_box(), page.locator(".tp-map").bounding_box()
            assert box is not None
            assert map_box is not None
            assert box["height"] * box["width"] < 0.3 * map_box["height"] * map_box["width"]
            page.click("text=Clear fault")
            expect(page.locator(".tp-fault")).to_be_hidden()


def test_a_fault_takes_two_lines_on_a_low_screen(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 1024, "height": 600})
    robot.fault, robot.fault_words, robot.fault_cure = Fault.STALL_LEFT, "left wheels stalled", STALLED
    for part in (".tp-fault-words", ".tp-fault-cure", ".tp-fault button"):
        expect(page.locator(part)).to_be_visible()
    box = page.locator(".tp-fault").bounding_box()
    assert box is not None
    assert box["height"] <= 50
    robot.simulated_faults["slip.left"] = 0.5
    expect(page.locator(".tp-fault-injected")).to_contain_text("slip.left")
    expect(page.locator(".tp-fault-injected")).to_be_visible()


def test_a_phone_on_its_side_shows_map_and_joystick_beside_each_other(page: Page) -> None:
    for width, height in ((844, 390), (667, 375)):
        page.set_viewport_size({"width": width, "height": height})
        page.reload()
        expect(page.locator(".tp-charts")).to_be_hidden()
        boxes = [
            page.locator(name).bounding_box()
            for name in (".tp-map", ".tp-stick", ".tp-estop", ".tp-cancel", ".tp-arm", ".tp-override")
        ]
        map_box, stick, stop, *_ = shown = [box for box in boxes if box is not None]
        assert len(shown) == len(boxes)
        assert map_box["x"] + map_box["width"] < stick["x"]
        assert map_box["height"] > 0.45 * height
        for box in shown:
            assert box["y"] + box["height"] <= height
            assert box is stop or box["y"] > stop["y"] + stop["height"]
        page.click("text=Wheels")
        expect(page.locator(".tp-charts > div").nth(1)).to_be_in_viewport(ratio=1.0)


def test_no_arrow_covers_a_tab(page: Page) -> None:
    for size in ((1440, 900), (1024, 768), (390, 844), (360, 640), (844, 390), (667, 375)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.wait_for_timeout(300)  # Quasar measures the tabs
        expect(page.locator(".tp-tab-system")).to_be_in_viewport(ratio=1.0)
        expect(page.locator(".tp-tabs .q-tabs__arrow:visible")).to_have_count(0)


def test_a_phone_names_its_tools(page: Page) -> None:
    for width in (390, 360):
        page.set_viewport_size({"width": width, "height": 664})
        names = page.locator(".tp-toolbar button small:visible")
        assert names.all_inner_texts()[:3] == ["Pan", "Goal", "Route"]
        assert names.count() == 10
        boxes = [box for name in names.all() if (box := name.bounding_box()) is not None]
        for left, right in itertools.pairwise(boxes):
            assert left["x"] + left["width"] <= right["x"]
        assert boxes[-1]["x"] + boxes[-1]["width"] <= width


def test_a_notice_on_a_phone_covers_no_control(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 664})
    robot.event(
        "the map was not saved: the disk of the robot's computer is full; delete old recordings from it"
    )
    notice = page.locator(".tp-notice").bounding_box()
    tools, stick = (page.locator(name).bounding_box() for name in (".tp-toolbar", ".tp-stick"))
    assert notice is not None
    assert tools is not None
    assert stick is not None
    assert tools["y"] + tools["height"] <= notice["y"]
    assert notice["y"] + notice["height"] <= stick["y"]


def test_header_fits_on_a_phone_with_its_longest_state(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    robot.state = State.DISARMED
    expect(page.locator(".tp-board")).to_contain_text("disarmed")
    assert page.locator(".tp-header").evaluate("head => head.scrollWidth <= head.clientWidth")


def test_arm_needs_no_scroll_on_a_phone(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    for name in (".tp-arm", "button >> text=Explore"):
        button, stop = page.locator(name).bounding_box(), page.locator(".tp-estop").bounding_box()
        assert button is not None
        assert stop is not None
        assert button["y"] + button["height"] <= stop["y"]


def test_buttons_and_chart_keys_take_one_line(page: Page) -> None:
    tops_px = "all => all.map((one) => Math.round(one.getBoundingClientRect().top))"
    for width_px in (1440, 1024):
        page.set_viewport_size({"width": width_px, "height": 900})
        page.click(".tp-tab-gains")
        expect(page.locator("[data-gain=kp]")).to_be_visible()  # the board's answer comes after the buttons
        save = page.locator(".q-tab-panel:has([data-gain=kp]) .tp-buttons > button")
        assert len(set(save.evaluate_all(tops_px))) == 1, width_px
        page.click(".tp-tab-drive")
        expect(page.locator(".tp-stick")).to_be_visible()
        buttons = page.locator(".tp-buttons > button:visible")
        assert buttons.count() == 4
        assert len(set(buttons.evaluate_all(tops_px))) == 1, width_px
        for head in page.locator(".tp-charthead").all():
            assert len(set(head.locator("span").evaluate_all(tops_px))) == 1, width_px


def test_low_screen_shows_everything(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 1024, "height": 600})
    page.reload()
    charts = page.locator(".tp-charts")
    expect(charts).to_be_hidden()
    for name in (".tp-mapbox", ".tp-state", ".tp-wheels", ".tp-stick"):
        box = page.locator(name).bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= 600, name
    lefts_px = page.locator(".tp-toolbar button").evaluate_all(
        "all => all.map((one) => one.getBoundingClientRect().left)"
    )
    assert len(lefts_px) > 5
    assert len(set(lefts_px)) == 1  # one column
    map_box = page.locator(".tp-mapbox").bounding_box()
    robot.reason = "driven by another program; an obstacle ahead limits it, and this takes a second line"
    expect(page.locator(".tp-reason")).to_have_attribute("title", re.compile("second line"))
    assert page.locator(".tp-mapbox").bounding_box() == map_box
    page.click("[data-tool=zone]")
    expect(page.locator(".tp-waypointbar:visible")).to_be_visible()
    expect(page.locator(".tp-toolname")).to_have_text("Zone")  # the tools are icons
    page.click("[data-tool=layers]", trial=True)  # the bar does not cover it
    page.click("[data-tool=pan]")
    page.click("text=Wheels")
    expect(charts).to_be_visible()
    expect(page.locator(".tp-charts > div").last).to_be_in_viewport(ratio=1.0)
    assert page.locator(".tp-left").evaluate("left => left.scrollHeight <= left.clientHeight")
    assert page.locator(".tp-charthead").evaluate_all(CUT) == []


def test_the_tools_take_one_column_and_the_map_most_of_the_height(page: Page) -> None:
    for width_px, height_px in ((1440, 900), (1024, 768), (1100, 760)):
        page.set_viewport_size({"width": width_px, "height": height_px})
        lefts_px = page.locator(".tp-toolbar button:visible").evaluate_all(
            "all => all.map((one) => one.getBoundingClientRect().left)"
        )
        assert len(set(lefts_px)) == 1, width_px
        map_box = page.locator(".tp-mapbox").bounding_box()
        assert map_box is not None
        assert map_box["height"] > 0.45 * height_px, width_px


def test_map_has_legend_and_mouse_position(page: Page) -> None:
    page.click("[data-tool=layers]")
    swatches = page.locator(".tp-layers label i")
    colours = swatches.evaluate_all("all => all.map((one) => getComputedStyle(one).backgroundColor)")
    assert len(set(colours)) == len(colours) == 10
    assert "rgba(0, 0, 0, 0)" not in colours
    page.keyboard.press("Escape")
    x, y = page.evaluate("""() => {
      const view = document.querySelector('.tp-map').mapView;
      const box = view.canvas.getBoundingClientRect();
      const [x, y] = view.camera.toScreen(1.5, 0.5);
      return [x + box.left, y + box.top];
    }""")
    page.mouse.move(round(x), round(y))
    expect(page.locator(".tp-cursor")).to_have_text(re.compile(r"x 1\.(49|5\d), y 0\.(49|5\d) m"))
    page.mouse.move(5, 5)
    expect(page.locator(".tp-cursor")).to_have_text("")


def test_only_the_banner_reports_a_lost_connection(page: Page) -> None:
    page.evaluate(
        "document.getElementById('popup').ariaHidden = 'false'"
    )  # as NiceGUI does, which then fades it in
    expect(page.locator("#popup")).to_have_css("display", "none")


def test_phone_shows_map_and_joystick_together(page: Page) -> None:
    for height in (844, 664):
        page.set_viewport_size({"width": 390, "height": height})
        expect(page.locator(".tp-estop small")).to_be_hidden()  # there is no Space key
        tops = [page.locator(name).bounding_box() for name in (".tp-map canvas", ".tp-stick", ".tp-estop")]
        canvas, stick, stop = (box for box in tops if box is not None)
        assert canvas["height"] >= 150
        assert canvas["y"] + canvas["height"] < stick["y"]
        assert stick["y"] + stick["height"] <= stop["y"]


ON_TOP = """button => {
  const box = button.getBoundingClientRect();
  return button.contains(document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2));
}"""


def test_a_low_phone_has_the_commands_beside_the_joystick(page: Page) -> None:
    for width, height in ((390, 664), (360, 640)):
        page.set_viewport_size({"width": width, "height": height})
        stop = page.locator(".tp-estop").bounding_box()
        assert stop is not None
        buttons = page.locator(".tp-commands > button").all()
        assert len(buttons) == 4
        for button in buttons:
            box = button.bounding_box()
            assert box is not None
            assert box["y"] + box["height"] <= stop["y"]  # else a tap on it is an emergency stop
            assert box["height"] >= 44
            assert button.evaluate(ON_TOP), (height, button.text_content())


def test_the_mouse_position_covers_no_tool_on_a_phone(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.hover(".tp-map canvas")
    expect(page.locator(".tp-cursor")).to_have_text(re.compile(r"x .* m"))
    tools, position = (
        page.locator(f".tp-map {part}").bounding_box() for part in (".tp-toolbar", ".tp-cursor")
    )
    assert tools is not None
    assert position is not None
    assert tools["y"] + tools["height"] <= position["y"]


def test_a_phone_shows_no_empty_message(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.click(".tp-tab-gains")
    expect(page.locator("[data-gain=kp]")).to_be_visible()
    expect(page.locator(".tp-message").first).to_be_hidden()


def test_a_phone_hides_the_map_beside_panels_that_do_not_need_it(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    box = page.locator(".tp-mapbox")
    for tab in ("gains", "tune", "log", "sim"):
        page.click(f".tp-tab-{tab}")
        expect(box).to_be_hidden()
    page.click("text=Add a pillar")
    expect(box).to_be_visible()
    page.click("[data-tool=pan]")
    expect(box).to_be_hidden()
    page.locator(".tp-estop").dispatch_event("pointerdown")
    expect(page.locator(".tp-fault")).to_be_visible()  # it is on the map
    page.click("text=Clear fault")
    expect(box).to_be_hidden()
    page.click(".tp-tab-drive")
    expect(box).to_be_visible()
    assert robot.fault == 0


def test_the_tabs_keep_their_place_on_a_phone(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    tabs = page.locator(".tp-tabs")
    place = tabs.bounding_box()
    for tab in ("map", "gains", "tune", "sim", "log", "system", "drive"):
        page.click(f".tp-tab-{tab}")
        expect(page.locator(f".tp-tab-{tab}")).to_have_attribute("aria-selected", "true")
        assert tabs.bounding_box() == place, tab
        page.locator(".tp-main").evaluate("main => main.scrollTo(0, main.scrollHeight)")
        assert tabs.bounding_box() == place, tab


def test_a_phone_shows_a_low_map_above_the_lists_until_a_tool_needs_it(page: Page) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    box = page.locator(".tp-mapbox")
    page.click(".tp-tab-map")
    expect(box).to_have_css("height", "200px")
    page.click("[data-tool=goal]")
    expect(box).to_have_css("height", "318px")


def test_phone_layout_shows_everything(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    robot.goal = Pose2(x_m=1.0, y_m=1.0)
    expect(page.locator("[data-field=mode]")).to_have_text("driving")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    for tab in ("drive", "map", "gains", "tune", "sim", "log", "system"):
        page.click(f".tp-tab-{tab}")
        stop = page.locator(".tp-estop").bounding_box()
        assert stop is not None
        assert stop["y"] + stop["height"] <= 844
        assert stop["width"] > 300
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        main = page.locator(".tp-main").bounding_box()
        assert main is not None
        assert main["y"] + main["height"] <= stop["y"]  # it covers nothing
    tools, canvas = (page.locator(f".tp-map {part}").bounding_box() for part in (".tp-toolbar", "canvas"))
    assert tools is not None
    assert canvas is not None
    assert tools["y"] + tools["height"] <= canvas["y"]


def test_every_axis_has_two_labels_after_a_reversal(page: Page) -> None:
    page.wait_for_function("document.querySelector('.tp-wheels').charts?.rows.length > 0")
    for height in (900, 760):
        page.set_viewport_size({"width": 1440, "height": height})
        counts = page.evaluate(
            """() => {
              const charts = document.querySelector('.tp-wheels').charts;
              charts.frozen = false;
              const last_s = charts.rows.at(-1)[0];
              const row = (k) => [last_s + 0.1 * k, ...Array(10).fill(8.4 * Math.cos(k))];
              charts.append(Array.from({ length: 50 }, (_, k) => row(k)));
              charts.frozen = true; // a row from the robot, earlier than these, would empty the charts
              charts.plots.forEach(({ chart }) => chart.redraw());
              return new Promise((done) => requestAnimationFrame(() => done(
                charts.plots.map(({ chart }) => chart.axes[1]._values.length))));
            }"""
        )
        assert min(counts) >= 2, (height, counts)


def test_both_sides_have_the_same_scale(page: Page) -> None:
    page.wait_for_function("document.querySelector('.tp-wheels').charts?.rows.length > 0")
    ranges = page.evaluate(
        """() => {
          const charts = document.querySelector('.tp-wheels').charts;
          const last_s = charts.rows.at(-1)[0];
          charts.append([[last_s + 0.1, 1, 1, 50, 0, 0, 9, 8, 200, 0, 0]]);
          charts.frozen = true; // a row from the robot, earlier than this one, would empty the charts
          return new Promise((done) => requestAnimationFrame(() => done(
            charts.plots.map(({ chart }) => [chart.scales.y.min, chart.scales.y.max]))));
        }"""
    )
    assert ranges[0] == ranges[1] != ranges[2] == ranges[3]
    assert ranges[0][1] > 9.5  # no line is at the edge, where half of it would be cut
    assert ranges[2][1] > 210
