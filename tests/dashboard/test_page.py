"""The page in a real browser: what is shown, what is ordered, what is refused."""

import math
import time
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.dashboard.conftest import Server, free_port, until
from tests.dashboard.fake_robot import FakeRobot
from thumper.geometry import Pose2
from thumper.link.messages import Fault
from thumper.service.requests import Ask, EmergencyStop, GoTo, Heartbeat, Relocate, Velocity

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


def asked(robot: FakeRobot, name: str) -> list[Ask]:
    return [ask for ask in robot.said(Ask) if ask.name == name]


def test_what_the_robot_sends_is_drawn(page: Page) -> None:
    expect(page.locator("#tp-banner")).to_have_text("Simulated robot")
    expect(page.locator(".tp-battery [data-field=battery]")).to_have_text("7.62 V")
    page.wait_for_function("document.querySelector('.tp-map').mapView.data.scan.length > 1000")
    points = page.evaluate("Array.from(document.querySelector('.tp-map').mapView.data.scan)")
    for x_m, y_m in zip(points[::2], points[1::2], strict=True):  # on a wall of the room, as drawn
        assert min(abs(x_m), abs(x_m - 4.0), abs(y_m), abs(y_m - 3.0)) < 0.08
    wall, free = page.evaluate("""() => {
      const { image } = document.querySelector('.tp-map').mapView.grids.map;
      const pixel = (column, row) => Array.from(
        image.getContext('2d').getImageData(column, image.height - 1 - row, 1, 1).data);
      return [pixel(65, 54), pixel(20, 54)];
    }""")
    assert wall == [27, 39, 51, 255]  # the box of the room is where the grid has it, and not upside down
    assert free == [251, 252, 253, 255]
    page.wait_for_function("document.querySelector('.tp-wheels').charts.rows.length > 5")


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
    pose = until(lambda: robot.said(Relocate))[0].map_from_base
    assert (pose.x_m, pose.y_m, pose.theta_rad) == pytest.approx((2.0, 1.0, 0.0), abs=0.03)
    page.keyboard.press("w")
    for place_m in ((1.0, 0.5), (3.0, 0.5), (3.0, 1.2)):
        drag(page, place_m, place_m)
    page.click(".tp-route >> text=Drive")
    goals = until(lambda: robot.said(GoTo))[0].goals
    assert [(g.x_m, g.y_m) for g in goals] == [
        pytest.approx(place_m, abs=0.02) for place_m in ((1.0, 0.5), (3.0, 0.5), (3.0, 1.2))
    ]
    assert goals[1].theta_rad == pytest.approx(math.pi / 2, abs=0.03)  # towards the next one


@pytest.mark.parametrize("how", ["button", "Space", "Escape", "Space in a field"])
def test_emergency_stop(page: Page, robot: FakeRobot, how: str) -> None:
    if how == "button":
        page.click(".tp-estop")
    elif how == "Space in a field":
        page.click(".tp-tab-gains")
        page.locator("[data-gain=kp]").click()
        page.keyboard.press("Space")
    else:
        page.click("text=Disarm")  # its focus must not swallow the key
        page.keyboard.press(how)
    until(lambda: robot.said(EmergencyStop))
    fault = page.locator(".tp-fault")
    expect(fault).to_be_visible()
    expect(fault).to_contain_text("the emergency stop was pressed")
    fault.locator("text=Clear fault").click()
    expect(fault).to_be_hidden()


def test_a_fault_is_shown_with_its_cure(page: Page, robot: FakeRobot) -> None:
    robot.fault_words = "stall left"
    robot.fault_cure = "the left wheels do not turn; are they blocked?"
    robot.fault, robot.battery_V = Fault.STALL_LEFT, 6.9
    expect(page.locator(".tp-fault-words")).to_have_text("stall left")
    expect(page.locator(".tp-fault-cure")).to_have_text(robot.fault_cure)
    expect(page.locator(".tp-battery")).to_have_css("background-color", "rgb(207, 34, 46)")


def test_the_log_holds_what_was_said_before_its_tab_was_opened(page: Page, robot: FakeRobot) -> None:
    robot.event("a wheel slips")
    robot.fault_words = robot.fault_cure = "stall left"
    robot.fault = Fault.STALL_LEFT
    expect(page.locator(".tp-fault-words")).to_have_text("stall left")
    page.click(".tp-tab-log")
    expect(page.locator(".tp-logline", has_text="a wheel slips")).to_be_visible()


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


def test_what_is_wrong_with_a_simulated_robot_is_shown_to_every_page(page: Page, robot: FakeRobot) -> None:
    robot.simulated_faults["slip.left"] = 0.5  # by somebody else
    page.click(".tp-tab-sim")
    expect(page.locator(".tp-faults-on")).to_have_text("Wrong now: slip.left 0.5")
    page.locator(".tp-faultrow .q-select", has_text="How").click()
    page.locator(".q-menu >> text=unplugged").click()
    page.click("text=Do it")
    wrong = "Wrong now: slip.left 0.5, lidar unplugged"
    expect(page.locator(".tp-faults-on")).to_have_text(wrong)
    page.reload()
    page.click(".tp-tab-sim")
    expect(page.locator(".tp-faults-on")).to_have_text(wrong)


def test_the_stick_drives_while_it_is_held(page: Page, robot: FakeRobot) -> None:
    box = page.locator(".tp-stick").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 0.35 * box["height"])
    until(lambda: len(robot.said(Velocity)) > 5)
    twist = robot.said(Velocity)[-1].twist
    assert twist.v_m_s == pytest.approx(0.4, abs=0.02)  # half of 0.8 m/s: no turbo
    assert twist.w_rad_s == pytest.approx(0.0, abs=0.05)
    page.mouse.up()
    until(lambda: robot.said(Velocity)[-1].twist.v_m_s == 0.0)
    count = len(robot.said(Velocity))
    time.sleep(0.3)
    assert len(robot.said(Velocity)) == count  # silence once it has let go


PAD = """([lb, forward, stop]) => {
  const pressed = (button) => button === 4 && lb || button === stop;
  const buttons = Array.from({ length: 17 }, (_, button) => ({ pressed: pressed(button) }));
  navigator.getGamepads = () => [{ connected: true, id: "pad", buttons, axes: [0, -forward, 0, 0] }];
}"""


def test_a_gamepad_drives_while_its_button_is_held_and_the_page_has_the_focus(
    page: Page, robot: FakeRobot
) -> None:
    def drives() -> bool:
        robot.asked.clear()
        time.sleep(0.4)
        return any(velocity.twist.v_m_s > 0.3 for velocity in robot.said(Velocity))

    page.evaluate(PAD, [True, 1.0])
    assert not drives()  # held when it was first seen: it must be let go of once
    page.evaluate(PAD, [False, 1.0])
    assert not drives()
    page.evaluate(PAD, [True, 1.0])
    assert until(drives)
    page.evaluate("document.hasFocus = () => false")  # the browser shows the pad as it was, for ever
    until(lambda: [v for v in robot.said(Velocity) if v.twist.v_m_s == 0.0])
    assert not drives()
    page.evaluate(PAD, [True, 1.0, 1])
    until(lambda: robot.said(EmergencyStop))  # the stop needs no focus
    page.evaluate(PAD, [True, 1.0])
    page.evaluate("document.hasFocus = () => true")
    assert not drives()
    page.evaluate(PAD, [False, 0.0])
    time.sleep(0.2)
    page.evaluate(PAD, [True, 1.0])
    assert until(drives)


def test_the_trail_ends_where_another_map_begins(page: Page, robot: FakeRobot) -> None:
    length = "document.querySelector('.tp-map').mapView.data.trail.length"
    page.wait_for_function(f"{length} > 8")
    before = page.evaluate(length)
    robot.lidar_scans = 3
    page.wait_for_function(f"{length} < {before}")


def test_the_report_does_not_keep_the_stop_to_itself(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-tune")
    page.wait_for_selector(".tp-tune iframe", state="attached")
    assert page.evaluate("""() => {
      const frame = document.querySelector('.tp-tune iframe');
      frame.hidden = false;
      frame.focus();
      return document.activeElement === frame;
    }""")
    page.wait_for_function("document.activeElement.tagName !== 'IFRAME'")
    page.keyboard.press("Space")
    until(lambda: robot.said(EmergencyStop))


def test_charts_freeze_and_are_saved(page: Page) -> None:
    rows = "document.querySelector('.tp-wheels').charts.rows.length"
    page.wait_for_function(f"{rows} > 5")
    page.click("[data-chart=freeze]")
    count = page.evaluate(rows)
    with page.expect_download() as download:
        page.click("[data-chart=csv]")
    lines = download.value.path().read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("time_s,left_setpoint_rad_s,left_speed_rad_s,left_pwm,left_integral_pwm")
    assert len(lines) == 1 + count == 1 + page.evaluate(rows)
    assert {len(line.split(",")) for line in lines} == {11}


def test_recording(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-record")
    until(lambda: robot.recording)
    expect(page.locator("[data-field=recorded]")).to_have_text("0:01")
    page.click(".tp-record")
    until(lambda: not robot.recording)


def test_a_real_robot_is_named_so(page: Page, robot: FakeRobot) -> None:
    robot.simulated = False
    try:
        expect(page.locator("#tp-banner")).to_have_text("Real robot: it moves")
        expect(page.locator(".tp-tab-sim")).to_be_hidden()
    finally:
        robot.simulated = True


def test_a_phone_shows_all_of_it(page: Page, robot: FakeRobot) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    robot.goal = Pose2(x_m=1.0, y_m=1.0)
    expect(page.locator("[data-field=mode]")).to_have_text("driving")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    for tab in ("drive", "gains", "tune", "sim", "log"):
        page.click(f".tp-tab-{tab}")
        stop = page.locator(".tp-estop").bounding_box()
        assert stop is not None
        assert stop["y"] + stop["height"] <= 844
        assert stop["width"] > 300
        assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_it_comes_back_when_the_server_does(page: Page, server: Server, robot: FakeRobot) -> None:
    server.kill()
    expect(page.locator("#tp-banner")).to_contain_text("No connection")
    server.start()
    page.wait_for_function("document.querySelector('#tp-banner')?.textContent === 'Simulated robot'")
    # The page may load itself anew in this moment: whoever wants a stop presses until it is said.

    def pressed_and_said() -> bool:
        page.keyboard.press("Escape")
        return bool(robot.said(EmergencyStop))

    until(pressed_and_said)


def test_it_follows_a_robot_that_was_started_anew(browser: Browser, tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    server = Server(address, tmp_path)  # before there is a robot
    page = browser.new_page()
    banner = page.locator("#tp-banner")
    try:
        page.goto(server.url)
        expect(banner).to_have_text("Waiting for the robot …")
        for _ in range(2):
            robot = FakeRobot(address=address)
            expect(banner).to_have_text("Simulated robot", timeout=15_000)
            page.click(".tp-estop")
            until(partial(robot.said, EmergencyStop))
            robot.close()
            expect(banner).to_contain_text("No word from the robot")
    finally:
        page.close()
        server.close()
