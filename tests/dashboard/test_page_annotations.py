"""The page in a real browser: zones and places, drawn by mouse, finger or keyboard, and their lists."""

from itertools import combinations
from typing import Any

import pytest
from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Browser, Page, expect

from tests.dashboard.test_page_driving import TO_SCREEN, drag, queries_of
from thumper.maps.annotations import Annotations, SavedPlace, SavedTag, Zone, ZoneKind

CORNERS = ((0.5, 0.5), (1.5, 0.5), (1.5, 1.2))
BAR = ".tp-annotationbar"


def rows(page: Page, which: str) -> Any:
    return page.locator(f".tp-places [data-list={which}] li")


def test_a_zone_drawn_on_one_page_shows_on_another(
    page: Page, browser: Browser, server: Server, robot: FakeRobot
) -> None:
    page.keyboard.press("z")
    save = page.locator(f"{BAR} >> text=Save")
    for corner in CORNERS:
        expect(save).to_be_disabled()
        drag(page, corner, corner)
    page.locator(f"{BAR} select").select_option("slow:30")
    page.locator(f"{BAR} input").fill("ramp")
    save.click()
    zone = until(lambda: robot.annotations.zones)[0]
    assert (zone.name, zone.kind, zone.speed_percent) == ("ramp", ZoneKind.SLOW, 30)
    assert [
        corner == pytest.approx(at, abs=0.02) for corner, at in zip(CORNERS, zone.vertices_m, strict=True)
    ]
    expect(page.locator(BAR)).to_be_hidden()
    context = browser.new_context(viewport={"width": 390, "height": 844})
    other = context.new_page()
    open_page(other, server)
    other.click(".tp-tab-map")
    expect(rows(other, "zones")).to_contain_text("rampslow, 30 %")
    drawn = "thumper.state.values.annotations.features.length"
    assert other.evaluate(drawn) == 1
    other.click("text=Remove")
    expect(rows(other, "zones")).to_contain_text("Remove ramp for good?")
    other.get_by_role("button", name="Keep ramp").click()
    expect(rows(other, "zones")).to_contain_text("rampslow, 30 %")
    other.click("text=Remove")
    other.get_by_role("button", name="Remove ramp for good").click()
    expect(rows(other, "zones")).to_contain_text("None yet")
    context.close()
    until(lambda: not robot.annotations.zones)
    page.wait_for_function(f"{drawn} === 0")


def test_places_are_saved_driven_to_and_patrolled(page: Page, robot: FakeRobot) -> None:
    for name, place_m in (("kitchen", (1.0, 1.0)), ("door", (3.0, 2.0))):
        page.keyboard.press("l")
        drag(page, place_m, (place_m[0] + 0.8, place_m[1]) if name == "door" else place_m)
        expect(page.locator(f"{BAR} input")).to_be_focused()
        page.keyboard.type(name)
        page.keyboard.press("Enter")
        until(lambda: any(place.name == name for place in robot.annotations.places))  # noqa: B023
    kitchen, door = robot.annotations.places
    assert (kitchen.x_m, kitchen.y_m) == pytest.approx((1.0, 1.0), abs=0.02)
    assert kitchen.yaw_rad is None
    assert door.yaw_rad == pytest.approx(0.0, abs=0.03)
    page.click(".tp-tab-map")
    rows(page, "places").first.locator("text=Go").click()
    until(lambda: [ask.content for ask in queries_of(robot, "mission/send")] == [{"place": "kitchen"}])
    page.locator("[data-patrol] select").select_option("5")
    page.click("[data-patrol] button")
    expected = {"goals": [{"place": "kitchen"}, {"place": "door"}], "rounds": 5}
    until(lambda: [ask.content for ask in queries_of(robot, "mission/follow")] == [expected])
    rows(page, "places").first.locator("input").uncheck()
    page.click("[data-patrol] button")
    until(lambda: queries_of(robot, "mission/follow")[-1].content["goals"] == [{"place": "door"}])


def test_labels_on_the_map_do_not_overlap(page: Page, robot: FakeRobot) -> None:
    zone = Zone(kind=ZoneKind.KEEPOUT, name="the rug of the kitchen", vertices_m=CORNERS)
    middle_m = zone.polygon_m().mean(axis=0)
    places = tuple(
        SavedPlace(name=name, x_m=middle_m[0] + shift_m, y_m=middle_m[1])
        for name, shift_m in (("kitchen table", 0.0), ("charger", 0.05), ("door to the hall", 0.2))
    )
    robot.annotate(Annotations(zones=(zone,), places=places))
    page.wait_for_function("thumper.state.values.annotations.features.length === 4")
    labels = page.evaluate("""() => {
      const { context } = document.querySelector('.tp-map').mapView;
      const found = [];
      context.fillText = (text, x, y) => {
        const { width } = context.measureText(text);
        if (context.textAlign === 'center') found.push([text, x - width / 2, x + width / 2, y]);
      };
      document.querySelector('.tp-map').mapView.draw();
      delete context.fillText;
      return found;
    }""")
    assert {text for text, *_ in labels} == {zone.name, *(place.name for place in places)}
    for (_, left, right, y), (_, other_left, other_right, other_y) in combinations(labels, 2):
        assert abs(y - other_y) > 12.0 or right <= other_left or other_right <= left


def test_a_name_in_use_is_replaced_only_on_request(page: Page, robot: FakeRobot) -> None:
    save = page.locator(f"{BAR} .tp-go")
    for x_m in (1.0, 3.0):
        page.keyboard.press("l")
        drag(page, (x_m, 1.0), (x_m, 1.0))
        page.keyboard.type("kitchen")
        page.keyboard.press("Enter")
        page.wait_for_function("thumper.state.values.annotations.features.length === 1")
    expect(page.locator(BAR)).to_contain_text("kitchen exists already. Replace it?")
    expect(save).to_have_text("Replace")
    page.keyboard.type("2")
    expect(save).to_have_text("Save")
    page.keyboard.press("Backspace")
    page.keyboard.press("Enter")
    expect(save).to_have_text("Replace")
    assert robot.annotations.places[0].x_m == pytest.approx(1.0, abs=0.02)
    page.keyboard.press("Enter")
    until(lambda: robot.annotations.places[0].x_m == pytest.approx(3.0, abs=0.02))


def test_the_keyboard_alone_draws_a_zone(page: Page, robot: FakeRobot) -> None:
    page.locator(".tp-map canvas").focus()
    page.keyboard.press("z")
    for key in ("ArrowRight", "ArrowUp", "ArrowLeft"):
        page.keyboard.press(f"Shift+{key}")
        page.keyboard.press("Enter")
    page.locator(f"{BAR} >> text=Save").focus()
    page.keyboard.press("Enter")
    zone = until(lambda: robot.annotations.zones)[0]
    assert zone.name == "keepout 1"
    width_m, height_m = zone.polygon_m().max(axis=0) - zone.polygon_m().min(axis=0)
    assert width_m > 0.1
    assert height_m == pytest.approx(width_m, rel=0.02)
    assert robot.fault == 0  # no key was taken for a stop


def test_a_button_shows_the_shortcuts_and_the_tools_have_names(page: Page) -> None:
    shortcuts = page.locator(".tp-shortcuts")
    page.click("[data-shortcuts]")
    expect(shortcuts).to_be_visible()
    page.click("[data-shortcuts]")
    expect(shortcuts).to_be_hidden()
    page.focus(".tp-drive input[type=checkbox]")
    page.keyboard.press("?")
    expect(shortcuts.locator("h2")).to_have_text("Keyboard shortcuts")
    shortcuts.get_by_role("button", name="Close").click()
    expect(shortcuts).to_be_hidden()
    names = page.locator(".tp-toolbar button small")
    expect(names.first).to_be_visible()
    assert all(names.all_inner_texts())
    too_wide = "all => all.filter((one) => one.scrollWidth > one.clientWidth).length"
    assert page.locator(".tp-toolbar button").evaluate_all(too_wide) == 0
    page.set_viewport_size({"width": 1024, "height": 600})
    expect(names.first).to_be_hidden()


def test_a_question_mark_shows_the_shortcuts(page: Page, robot: FakeRobot) -> None:
    shortcuts = page.locator(".tp-shortcuts")
    expect(shortcuts).to_be_hidden()
    page.keyboard.press("?")
    expect(shortcuts).to_contain_text("ZZone")
    page.keyboard.press("Escape")
    expect(shortcuts).to_be_hidden()
    page.keyboard.press("z")
    page.keyboard.press("Escape")
    assert robot.fault == 0  # it cancelled, it did not stop the robot


def test_touches_draw_a_zone_on_a_phone(browser: Browser, server: Server, robot: FakeRobot) -> None:
    robot.reset()
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    page = context.new_page()
    open_page(page, server)
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map")
    page.tap("[data-tool=zone]")
    for corner in CORNERS:
        page.touchscreen.tap(*page.evaluate(TO_SCREEN, list(corner)))
    page.tap(f"{BAR} >> text=Undo")
    expect(page.locator(f"{BAR} >> text=Save")).to_be_disabled()
    page.touchscreen.tap(*page.evaluate(TO_SCREEN, list(CORNERS[2])))
    page.tap(f"{BAR} >> text=Save")
    zone = until(lambda: robot.annotations.zones)[0]
    assert len(zone.vertices_m) == 3
    bar = page.evaluate("document.documentElement.scrollWidth")
    assert bar == 390
    context.close()


def test_a_surveyed_tag_is_listed_and_removed(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-map")
    expect(rows(page, "places")).to_contain_text("None yet")
    expect(page.locator("[data-tags]")).to_be_hidden()
    robot.annotate(Annotations(tags=tuple(SavedTag(number=n, x_m=1.0, y_m=n, yaw_rad=0.0) for n in (3, 14))))
    expect(rows(page, "tags")).to_have_count(2)
    expect(rows(page, "tags").first).to_contain_text("tag 3")
    rows(page, "tags").first.locator("text=Remove").click()
    page.get_by_role("button", name="Remove tag 3 for good").click()
    until(lambda: [tag.number for tag in robot.annotations.tags] == [14])
    expect(rows(page, "tags")).to_contain_text(["tag 14"])
