"""The page in a real browser: what is ordered by map, fields and buttons."""

import math

import pytest
from playwright.sync_api import Page, expect

from tests.dashboard.fake_robot import FakeRobot
from tests.live import until
from thumper.runtime.requests import GoTo, Heartbeat, Query, SetPose

TO_SCREEN = """([x, y]) => {
  const view = document.querySelector('.tp-map').mapView;
  const box = view.canvas.getBoundingClientRect();
  const [px, py] = view.camera.toScreen(x, y);
  return [px + box.left, py + box.top];
}"""


def drag(page: Page, start_m: tuple[float, float], end_m: tuple[float, float]) -> None:
    """Press on the map at one place and let go at another."""
    for what, place_m in (("down", start_m), ("up", end_m)):
        page.mouse.move(*page.evaluate(TO_SCREEN, list(place_m)))
        getattr(page.mouse, what)()


def asked(robot: FakeRobot, name: str) -> list[Query]:
    return [ask for ask in robot.said(Query) if ask.name == name]


def test_a_goal_is_dragged(page: Page, robot: FakeRobot) -> None:
    page.click("[data-tool=goal]")
    drag(page, (1.0, 1.0), (1.0, 2.0))
    ask = until(lambda: asked(robot, "mission/send"))[0]
    assert ask.content["x_m"] == pytest.approx(1.0, abs=0.02)
    assert ask.content["y_m"] == pytest.approx(1.0, abs=0.02)
    assert ask.content["yaw_rad"] == pytest.approx(math.pi / 2, abs=0.02)
    beats = until(lambda: robot.said(Heartbeat))
    assert {beat.source for beat in beats} == {ask.source}  # the page answers for its goal
    expect(page.locator("[data-field=mode]")).to_have_text("driving")
    page.click("text=Cancel goal")
    until(lambda: [ask.content for ask in asked(robot, "command")] == [{"command": "cancel"}])


def test_a_click_gives_a_goal_without_a_heading(page: Page, robot: FakeRobot) -> None:
    page.keyboard.press("g")
    drag(page, (1.0, 1.0), (1.0, 1.0))
    assert set(until(lambda: asked(robot, "mission/send"))[0].content) == {"x_m", "y_m"}


def test_pose_estimate_and_waypoints(page: Page, robot: FakeRobot) -> None:
    page.keyboard.press("p")
    drag(page, (2.0, 1.0), (3.0, 1.0))
    pose = until(lambda: robot.said(SetPose))[0].map_from_base
    assert (pose.x_m, pose.y_m, pose.theta_rad) == pytest.approx((2.0, 1.0, 0.0), abs=0.03)
    page.keyboard.press("w")
    for place_m in ((1.0, 0.5), (3.0, 0.5), (3.0, 1.2)):
        drag(page, place_m, place_m)
    page.click(".tp-waypointbar >> text=Drive")
    goals = until(lambda: robot.said(GoTo))[0].goals
    assert [(g.x_m, g.y_m) for g in goals] == [
        pytest.approx(place_m, abs=0.02) for place_m in ((1.0, 0.5), (3.0, 0.5), (3.0, 1.2))
    ]
    assert goals[1].theta_rad == pytest.approx(math.pi / 2, abs=0.03)  # towards the next one


def test_gains_are_applied_and_refused(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    number = page.locator("[data-gain=kp]")
    apply = page.locator(".q-tab-panel button", has_text="Apply")
    expect(number).to_have_value("6.1")
    expect(apply).to_be_disabled()
    number.fill("14.5")
    apply.click()
    until(lambda: robot.parameters["kp"] == 14.5)
    expect(page.locator(".tp-message")).to_have_text("The board works with kp 14.5")
    number.fill("999")  # refused by the page: nothing is sent
    expect(page.locator(".tp-gain", has_text="kp")).to_contain_text("give 0 … 60")
    before = len(asked(robot, "parameters/set"))
    apply.click()
    expect(page.locator(".tp-message")).to_contain_text("is refused")
    assert len(asked(robot, "parameters/set")) == before
    page.locator(".q-tab-panel button", has_text="Undo").click()
    expect(number).to_have_value("14.5")
    thumb = page.locator("[data-slider=ki]")
    thumb.click(position={"x": 5, "y": 10})
    apply.click()
    until(lambda: robot.parameters["ki"] < 2.0)
    page.locator("button", has_text="Save on board").click()
    until(lambda: asked(robot, "parameters/save"))


def test_recording(page: Page, robot: FakeRobot) -> None:
    dot = page.locator(".tp-dot")
    expect(dot).to_have_css("background-color", "rgba(0, 0, 0, 0)")
    page.click(".tp-record")
    until(lambda: robot.recording)
    expect(dot).to_have_css("background-color", "rgb(207, 34, 46)")
    expect(page.locator("[data-field=recorded]")).to_have_text("0:01")
    page.click(".tp-record")
    until(lambda: not robot.recording)
