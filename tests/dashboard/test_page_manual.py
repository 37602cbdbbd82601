"""The page in a real browser: emergency stop, joystick and gamepad."""

import time

import pytest
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Page, expect

from thumper.runtime.requests import EmergencyStop, Velocity

PAD = """([lb, forward, stop]) => {
  const pressed = (button) => button === 4 && lb || button === stop;
  const buttons = Array.from({ length: 17 }, (_, button) => ({ pressed: pressed(button) }));
  navigator.getGamepads = () => [{ connected: true, id: "pad", buttons, axes: [0, -forward, 0, 0] }];
}"""


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
    until(lambda: robot.received_of(EmergencyStop))
    fault = page.locator(".tp-fault")
    expect(fault).to_be_visible()
    expect(fault).to_contain_text("the emergency stop was pressed")
    fault.locator("text=Clear fault").click()
    expect(fault).to_be_hidden()


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
    page.mouse.up()
    until(lambda: robot.received_of(Velocity)[-1].twist.v_m_s == 0.0)
    count = len(robot.received_of(Velocity))
    time.sleep(0.3)
    assert len(robot.received_of(Velocity)) == count  # nothing more after the release


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
