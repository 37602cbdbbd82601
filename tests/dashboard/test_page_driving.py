"""The page in a real browser: commands from map, fields and buttons."""

import math

import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Page, expect

from thumper.board.messages import State
from thumper.common.geometry import Pose2
from thumper.ros.to_ros import WARN
from thumper.runtime.requests import Heartbeat, Query, SetPose

AWAY = Pose2(x_m=1.0, y_m=1.0, theta_rad=0.0)
TO_SCREEN = """([x, y]) => {
  const view = document.querySelector('.tp-map').mapView;
  const box = view.canvas.getBoundingClientRect();
  const [px, py] = view.camera.toScreen(x, y);
  return [px + box.left, py + box.top];
}"""


def drag(page: Page, start_m: tuple[float, float], end_m: tuple[float, float]) -> None:
    """Drag on the map from one position to another."""
    for what, place_m in (("down", start_m), ("up", end_m)):
        page.mouse.move(*page.evaluate(TO_SCREEN, list(place_m)))
        getattr(page.mouse, what)()


def queries_of(robot: FakeRobot, name: str) -> list[Query]:
    return [query for query in robot.received_of(Query) if query.name == name]


def test_goal_by_dragging(page: Page, robot: FakeRobot) -> None:
    page.click("[data-tool=goal]")
    drag(page, (1.0, 1.0), (1.0, 2.0))
    query = until(lambda: queries_of(robot, "mission/send"))[0]
    assert query.content["x_m"] == pytest.approx(1.0, abs=0.02)
    assert query.content["y_m"] == pytest.approx(1.0, abs=0.02)
    assert query.content["yaw_rad"] == pytest.approx(math.pi / 2, abs=0.02)
    # The page guards its goal. One that was just closed may send a last heartbeat, too.
    until(lambda: query.source in {heartbeat.source for heartbeat in robot.received_of(Heartbeat)})
    expect(page.locator("[data-field=mode]")).to_have_text("driving")
    page.locator(".tp-state").get_by_role("button", name="Cancel", exact=True).click()
    until(lambda: [query.content for query in queries_of(robot, "command")] == [{"command": "cancel"}])


def test_click_sets_a_goal_without_heading(page: Page, robot: FakeRobot) -> None:
    page.keyboard.press("g")
    drag(page, (1.0, 1.0), (1.0, 1.0))
    assert set(until(lambda: queries_of(robot, "mission/send"))[0].content) == {"x_m", "y_m"}


def test_pose_estimate_and_waypoints(page: Page, robot: FakeRobot) -> None:
    page.keyboard.press("p")
    drag(page, (2.0, 1.0), (3.0, 1.0))
    pose = until(lambda: robot.received_of(SetPose))[0].map_from_base
    assert (pose.x_m, pose.y_m, pose.theta_rad) == pytest.approx((2.0, 1.0, 0.0), abs=0.03)
    refusal = "the pose was not set: the robot is mapping"
    robot.event(refusal, WARN)
    expect(page.locator(".tp-notice.bad")).to_have_text(refusal)
    page.keyboard.press("r")
    drag(page, (1.0, 0.5), (1.0, 0.5))
    page.get_by_label("record", exact=True).check()
    page.get_by_label("beep", exact=True).check()
    expect(page.locator(".tp-waypointbar input[type=number]")).to_have_value("5")
    drag(page, (3.0, 0.5), (3.0, 1.2))  # with a heading
    page.click(".tp-waypointbar >> text=Drive")
    first, second = until(lambda: queries_of(robot, "mission/follow"))[0].content["goals"]
    assert (first["x_m"], first["y_m"]) == pytest.approx((1.0, 0.5), abs=0.02)
    assert (second["x_m"], second["y_m"]) == pytest.approx((3.0, 0.5), abs=0.02)
    nothing = {"wait_s": 0.0, "record": False, "beep": False}
    assert first | {"x_m": 0.0, "y_m": 0.0} == {"x_m": 0.0, "y_m": 0.0, **nothing}
    assert second["yaw_rad"] == pytest.approx(math.pi / 2, abs=0.03)
    assert (second["wait_s"], second["record"], second["beep"]) == (5.0, True, True)


def test_gains_are_applied_and_refused(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    number = page.locator("[data-gain=kp]")
    apply = page.locator(".q-tab-panel button", has_text="Apply")
    expect(number).to_have_value("6.1")
    expect(apply).to_be_disabled()
    number.fill("14.5")
    apply.click()
    until(lambda: robot.parameters["kp"] == 14.5)
    expect(page.locator(".tp-message")).to_have_text("The board now uses kp 14.5.")
    number.fill("999")  # refused by the page, not sent
    expect(page.locator(".tp-gain:has([data-gain=kp])")).to_contain_text("must be 0 … 60")
    expect(apply).to_be_disabled()
    page.locator(".q-tab-panel button", has_text="Undo").click()
    expect(number).to_have_value("14.5")
    thumb = page.locator("[data-slider=ki]")
    thumb.click(position={"x": 5, "y": 10})
    apply.click()
    until(lambda: robot.parameters["ki"] < 2.0)
    page.get_by_role("button", name="Save", exact=True).click()
    until(lambda: queries_of(robot, "parameters/save"))


def test_revert_needs_a_disarmed_board_and_a_reason_goes_with_it(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-gains")
    revert, message = page.get_by_role("button", name="Revert"), page.locator(".tp-message:visible")
    expect(revert).to_be_disabled()
    expect(revert).to_have_attribute("title", "disarm first")
    robot.state = State.DISARMED
    expect(revert).to_be_enabled()
    for leave in ("tab", "state", "edit"):
        page.get_by_role("button", name="Save", exact=True).click()
        expect(message).to_contain_text("Saved.")
        if leave == "tab":
            page.click(".tp-tab-log")
            page.click(".tp-tab-gains")
        elif leave == "state":
            robot.state = State.CLOSED_LOOP
        else:
            page.locator("[data-gain=kp]").fill("7")
        expect(message).to_have_text("")


def test_keys_move_a_slider_by_shares_of_its_range(page: Page) -> None:
    page.click(".tp-tab-gains")
    number, slider = page.locator("[data-gain=kp]"), page.get_by_role("slider", name="kp slider")
    expect(number).to_have_value("6.1")
    slider.locator("[tabindex]").first.focus()
    for key, value in (("ArrowRight", "6.7"), ("PageUp", "12.7"), ("ArrowDown", "12.1"), ("PageDown", "6.1")):
        page.keyboard.press(key)
        expect(number).to_have_value(value)
        expect(slider).to_have_attribute("aria-valuenow", value)


def test_recording(page: Page, robot: FakeRobot) -> None:
    dot = page.locator(".tp-dot")
    expect(dot).to_have_css("background-color", "rgba(0, 0, 0, 0)")
    page.click(".tp-record")
    until(lambda: robot.recording)
    expect(dot).to_have_css("background-color", "rgb(207, 34, 46)")
    expect(page.locator("[data-field=recorded]")).to_have_text("0:01")
    robot.recording_paused = True
    expect(page.locator("[data-field=recorded]")).to_have_text("disk full")
    page.click(".tp-record")
    until(lambda: not robot.recording)


def test_an_experiment_cannot_start_while_the_robot_drives(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-tune")
    page.check("[data-tune=clear]")
    identify, why = page.locator("[data-tune=identify]"), page.locator("[data-tune=why]")
    expect(identify).to_be_enabled()
    robot.goal = AWAY
    expect(identify).to_be_disabled()
    expect(why).to_have_text("The robot is driving: stop it first.")
    robot.goal = None
    expect(identify).to_be_enabled()
    expect(why).to_be_hidden()


def test_the_end_of_an_exploration_replaces_the_notice_of_its_start(page: Page, robot: FakeRobot) -> None:
    notices = page.locator(".tp-notice")
    page.click("button >> text=Explore")
    expect(notices).to_have_text(["exploring: explore"])
    robot.event("explored after 9 s: reached 2 of 2 frontiers; back at the start")
    expect(notices).to_have_text(["explored after 9 s: reached 2 of 2 frontiers; back at the start"])


def test_a_beep_of_the_robot_sounds_once(page: Page, robot: FakeRobot) -> None:
    page.evaluate(
        """() => {
          window.tones = [];
          const start = OscillatorNode.prototype.start;
          OscillatorNode.prototype.start = function () {
            window.tones.push(this.frequency.value);
            start.call(this);
          };
        }"""
    )
    robot.event("something else")
    robot.event("beep at waypoint 1 of 2")
    page.wait_for_function("window.tones.length > 0")
    assert page.evaluate("window.tones") == [880]
