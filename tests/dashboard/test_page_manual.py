"""The page in a real browser: emergency stop, joystick and gamepad."""

import time

import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Page, expect

from tests.variants import some_of
from thumper.board.messages import Fault, State
from thumper.common.geometry import Twist2
from thumper.runtime.requests import EmergencyStop, OverrideAssistance, Query, Velocity

PAD = """([lb, forward, stop]) => {
  const pressed = (button) => button === 4 && lb || button === stop;
  const buttons = Array.from({ length: 17 }, (_, button) => ({ pressed: pressed(button) }));
  navigator.getGamepads = () => [{ connected: true, id: "pad", buttons, axes: [0, -forward, 0, 0] }];
}"""

KNOB_OFFSET = """() => {
  const box = (name) => document.querySelector(name).getBoundingClientRect();
  const [area, knob] = [box('.tp-stick'), box('.tp-knob')];
  return knob.top + knob.height / 2 - area.top - area.height / 2;
}"""


@pytest.mark.parametrize(
    ("how", "pressed"),
    some_of(
        [
            ("button", "the STOP button"),
            ("Escape", "Esc"),
            ("Space", "Space"),
            ("Space in a field", "Space"),
        ],
        2,
    ),
)
def test_emergency_stop(page: Page, robot: FakeRobot, how: str, pressed: str) -> None:
    if how == "button":
        page.click(".tp-estop")
    elif how == "Space in a field":
        page.click(".tp-tab-gains")
        page.locator("[data-gain=kp]").click()
        page.keyboard.press("Space")
    else:
        page.click("text=Disarm")  # its focus must not swallow the key
        page.keyboard.press(how)
    until(lambda: robot.received_of(EmergencyStop))
    fault = page.locator(".tp-fault")
    expect(fault).to_be_visible()
    expect(page.locator(".tp-fault-words")).to_have_text(f"the emergency stop was pressed with {pressed}")
    expect(page.locator(".tp-fault-cure")).to_have_text("")
    mode = page.locator("[data-field=mode]")
    expect(mode).to_have_text("fault")
    fault.locator("text=Clear fault").click()
    expect(fault).to_be_hidden()
    expect(mode).to_have_text("idle")
    robot.fault, robot.fault_words = Fault.E_STOP, "emergency stop"  # by another client
    robot.fault_cure = "the emergency stop was pressed"
    expect(page.locator(".tp-fault-words")).to_have_text("the emergency stop was pressed")


def test_space_types_into_a_text_only_while_the_motors_are_off(page: Page, robot: FakeRobot) -> None:
    robot.state = State.DISARMED
    page.click(".tp-tab-map")
    name = page.get_by_label("name of the map")
    expect(page.locator("body")).to_have_attribute("data-board", "disarmed")
    name.press_sequentially("living room")
    expect(name).to_have_value("living room")
    assert not robot.received_of(EmergencyStop)
    robot.state = State.CLOSED_LOOP
    expect(page.locator("body")).to_have_attribute("data-board", "closed_loop")
    name.press("Space")
    until(lambda: robot.received_of(EmergencyStop))
    expect(name).to_have_value("living room")


def test_escape_cancels_the_tool_before_it_stops(page: Page, robot: FakeRobot) -> None:
    for tool in ("goal", "waypoints", "pose", "obstacle"):
        page.click(f"[data-tool={tool}]")
        page.keyboard.press("Escape")
        expect(page.locator("[data-tool=pan]")).to_have_class("on")
    page.keyboard.press("g")
    map_box = page.locator(".tp-map canvas").bounding_box()
    assert map_box is not None
    page.mouse.move(map_box["x"] + 300, map_box["y"] + 200)
    page.mouse.down()
    page.keyboard.press("Escape")
    page.mouse.up()
    page.click("[data-tool=layers]")
    page.keyboard.press("Escape")
    expect(page.locator(".tp-layers")).to_be_hidden()
    page.click(".tp-tab-sim")
    page.locator(".tp-faultrow .q-select", has_text="Kind").click()
    expect(page.locator(".q-menu")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.locator(".q-menu")).to_be_hidden()
    page.click("[data-tool=layers]")
    page.keyboard.press("Space")  # stops at once, whatever is open
    until(lambda: robot.received_of(EmergencyStop))
    assert len(robot.received_of(EmergencyStop)) == 1
    assert not [query for query in robot.received_of(Query) if query.name == "mission/send"]
    page.keyboard.press("Escape")  # closes the layers
    page.keyboard.press("Escape")  # one too many
    page.wait_for_timeout(550)
    assert len(robot.received_of(EmergencyStop)) == 1
    page.keyboard.press("Escape")  # nothing is left to cancel
    until(lambda: len(robot.received_of(EmergencyStop)) == 2)


def test_joystick_drives_while_held(page: Page, robot: FakeRobot) -> None:
    box = page.locator(".tp-stick").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 0.35 * box["height"])
    until(lambda: [v for v in robot.received_of(Velocity) if v.twist.v_m_s > 0.3])  # pressing sends zero
    twist = robot.received_of(Velocity)[-1].twist
    assert twist.v_m_s == pytest.approx(0.4, abs=0.02)  # half of 0.8 m/s: no turbo
    assert twist.w_rad_s == pytest.approx(0.0, abs=0.05)
    page.wait_for_function(f"({KNOB_OFFSET})() < -40")
    page.mouse.up()
    until(lambda: robot.received_of(Velocity)[-1].twist.v_m_s == 0.0)
    assert page.evaluate(KNOB_OFFSET) == pytest.approx(0.0, abs=1.0)  # the knob shows the release
    count = len(robot.received_of(Velocity))
    time.sleep(0.3)
    assert len(robot.received_of(Velocity)) == count  # nothing more after the release


def test_keys_drive_while_the_drive_tab_is_open(page: Page, robot: FakeRobot) -> None:
    def drives() -> bool:
        return any(velocity.twist.v_m_s > 0.3 for velocity in robot.received_of(Velocity))

    def stops() -> bool:
        return bool(robot.received_of(Velocity)[-1].twist == Twist2())

    page.keyboard.down("w")
    until(drives)
    expect(page.locator("[data-tool=pan]")).to_have_class("on")  # no tool has this key
    page.keyboard.up("w")
    until(stops)
    page.keyboard.down("ArrowUp")
    page.keyboard.down("a")
    until(lambda: [v for v in robot.received_of(Velocity) if v.twist.v_m_s > 0.3 and v.twist.w_rad_s > 0.3])
    page.keyboard.up("ArrowUp")
    until(lambda: robot.received_of(Velocity)[-1].twist.v_m_s == 0.0)
    page.keyboard.up("a")
    until(stops)
    for place in (".tp-map canvas", ".tp-tab-drive"):  # they have the arrow keys
        page.focus(place)
        robot.received.clear()
        for key, moves in (("ArrowUp", False), ("W", True)):
            page.keyboard.down(key)
            time.sleep(0.3)
            assert drives() == moves, (place, key)
            page.keyboard.up(key)
        until(stops)
    page.keyboard.down("w")
    robot.received.clear()
    until(drives)
    page.click(".tp-tab-map")
    until(stops)
    page.keyboard.up("w")
    robot.received.clear()
    page.keyboard.down("w")
    time.sleep(0.3)
    assert not robot.received_of(Velocity)
    page.keyboard.up("w")


def test_keys_do_not_drive_again_before_they_are_released(page: Page, robot: FakeRobot) -> None:
    page.keyboard.down("w")
    until(lambda: robot.received_of(Velocity))
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    until(lambda: robot.received_of(Velocity)[-1].twist == Twist2())
    robot.received.clear()
    page.keyboard.down("w")  # repeats
    time.sleep(0.3)
    assert not robot.received_of(Velocity)
    page.keyboard.up("w")


def test_the_page_says_who_drives(page: Page, robot: FakeRobot) -> None:
    chip, reason = page.locator(".tp-board"), page.locator(".tp-reason")
    robot.reason = "driven by teleop; slowed"
    expect(chip).to_contain_text("armed")
    expect(reason).to_have_text("driven from another page or program; slowed")
    page.keyboard.down("w")
    expect(reason).to_have_text("driven from this page; slowed")
    page.keyboard.up("w")
    robot.experiment = "tune"
    expect(chip.locator("[data-field]")).to_have_text("tuning")


def test_shift_and_its_button_override_the_assistance(page: Page, robot: FakeRobot) -> None:
    box = page.locator(".tp-stick").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - 0.3 * box["height"])
    until(lambda: [v for v in robot.received_of(Velocity) if v.twist.v_m_s > 0.2])
    assert not robot.received_of(OverrideAssistance)
    page.keyboard.down("Shift")
    until(lambda: robot.received_of(OverrideAssistance))
    page.keyboard.up("Shift")
    time.sleep(0.3)
    robot.received.clear()
    time.sleep(0.3)
    assert robot.received_of(Velocity)
    assert not robot.received_of(OverrideAssistance)
    page.dispatch_event(".tp-override", "pointerdown", {"pointerId": 7})  # the other thumb on a phone
    until(lambda: robot.received_of(OverrideAssistance))
    page.mouse.up()


def test_gamepad_needs_deadman_button_and_focus(page: Page, robot: FakeRobot) -> None:
    def drives() -> bool:
        robot.received.clear()
        time.sleep(0.4)
        return any(velocity.twist.v_m_s > 0.3 for velocity in robot.received_of(Velocity))

    let_go = "!document.querySelector('.tp-drive').manualDrive.mustRelease"
    page.evaluate(PAD, [True, 1.0])
    assert not drives()  # held when it was first seen: it must be let go of once
    page.evaluate(PAD, [False, 1.0])
    page.wait_for_function(let_go)
    assert not drives()
    page.evaluate(PAD, [True, 1.0])
    assert until(drives)
    page.evaluate("document.hasFocus = () => false")  # the browser shows the pad as it was, for ever
    until(lambda: [v for v in robot.received_of(Velocity) if v.twist.v_m_s == 0.0])
    assert not drives()
    page.evaluate(PAD, [True, 1.0, 1])
    until(lambda: robot.received_of(EmergencyStop))  # the stop needs no focus
    page.evaluate(PAD, [True, 1.0])
    page.evaluate("document.hasFocus = () => true")
    assert not drives()
    page.evaluate(PAD, [False, 0.0])
    page.wait_for_function(let_go)
    page.evaluate(PAD, [True, 1.0])
    assert until(drives)


def test_focused_report_does_not_block_the_stop_key(page: Page, robot: FakeRobot) -> None:
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
    until(lambda: robot.received_of(EmergencyStop))


def test_the_joystick_shows_what_to_do_before_it_drives(page: Page, robot: FakeRobot) -> None:
    block, knob = page.locator(".tp-stick b"), page.locator(".tp-knob")
    expect(knob).to_be_visible()
    expect(block).to_be_empty()
    robot.state = State.DISARMED
    expect(block).to_have_text("Press Arm first")
    expect(knob).to_be_hidden()
    page.focus(".tp-stick")
    page.keyboard.down("ArrowUp")
    until(lambda: robot.received_of(Velocity))
    expect(page.locator(".tp-speeds span")).to_have_text(["", ""])
    page.keyboard.up("ArrowUp")
    robot.fault, robot.fault_words = Fault.STALL_LEFT, "left wheels stalled"
    expect(block).to_have_text("Clear the fault first")
    robot.fault, robot.fault_words = Fault.LINK_LOST, "connection lost"
    expect(block).to_have_text("Press Arm first")  # that clears it, too


def test_the_help_for_driving_is_closed_at_first(page: Page) -> None:
    text = page.locator(".tp-hint p", has_text="Hold the joystick")
    expect(text).to_be_hidden()
    page.click("text=How to drive")
    expect(text).to_be_visible()
    expect(page.locator(".tp-pad")).to_have_text("Gamepad: press a button to connect it")
