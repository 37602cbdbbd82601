"""The robot on the site's front page, in Chromium: it drives, and stops as the firmware decides."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.dashboard.built_site import build_robot
from tests.variants import some_of
from thumper.board.fault_texts import FAULT_NAMES
from thumper.board.messages import PARAMETERS, Fault

FIRST_MOTION_MS = 10_000
MAX_BYTES = 1_000_000
KP = next(setting for setting in PARAMETERS if setting.name == "kp")
MOTION_MS = 60_000  # for a busy machine, which simulates slower than real time


@pytest.fixture
def front_page(browser: Browser, site: Path) -> Iterator[Page]:
    """The front page, opened as a file, offline; a request elsewhere or a script's error fails the test."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, has_touch=True)
    context.set_offline(True)
    page = context.new_page()
    outside: list[str] = []
    problems: list[str] = []
    local = (site.as_uri(), "data:", "blob:")
    page.on("request", lambda one: None if one.url.startswith(local) else outside.append(one.url))
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.goto((site / "index.html").as_uri())
    yield page
    context.close()
    assert not outside
    assert not problems


def wait(page: Page, condition: str, timeout_ms: int = MOTION_MS) -> None:
    """Wait for a condition on the newest telemetry `now` and the robot's pose `at`."""
    page.wait_for_function(
        f"""() => {{
          const {{ newest: now, pose: at }} = document.getElementById("robot").simulation;
          return now && ({condition});
        }}""",
        timeout=timeout_ms,
    )


def test_robot_drives_by_itself_within_ten_seconds(front_page: Page, site: Path) -> None:
    wait(front_page, "now.left_speed > 1000 && now.right_speed > 1000", FIRST_MOTION_MS)
    assert sum(path.stat().st_size for path in (site / "robot").iterdir()) <= MAX_BYTES


def test_speed_charts_of_both_sides_have_one_scale(front_page: Page) -> None:
    wait(front_page, "true")
    front_page.evaluate("""() => {
      const { prototype } = CanvasRenderingContext2D;
      const { fillText } = prototype;
      window.highest = {};
      prototype.fillText = function (text, ...place) {
        const side = this.canvas.dataset.chart;
        if (side && Number(text) > 0) window.highest[side] = text;
        fillText.call(this, text, ...place);
      };
      document.getElementById("robot").simulation.history.at(-1).right_speed = 13_000;
    }""")
    front_page.locator("[data-chart=left]").scroll_into_view_if_needed()
    front_page.wait_for_function("highest.left === '13' && highest.right === '13' && highest.pwm === '255'")


def test_keys_drive_and_their_release_stops(front_page: Page) -> None:
    wait(front_page, "true")
    front_page.locator(".robot-room").focus()
    front_page.keyboard.down("ArrowDown")
    wait(front_page, "now.left_setpoint < -5000 && now.right_setpoint < -5000")
    wait(front_page, "Math.abs(now.left_speed - now.left_setpoint) < 700 && now.left_pwm < 0")
    front_page.keyboard.up("ArrowDown")
    wait(front_page, "now.left_setpoint === 0 && now.left_speed === 0 && now.right_speed === 0")
    front_page.keyboard.down("a")
    wait(front_page, "now.left_speed < -1000 && now.right_speed > 1000")
    front_page.keyboard.up("a")
    wait(front_page, "now.left_speed === 0 && now.right_speed === 0")


def test_keys_drive_after_the_link_to_the_robot(front_page: Page) -> None:
    wait(front_page, "true")
    for _ in range(2):
        front_page.get_by_role("link", name="Drive one here").click()
        expect(front_page.locator(".robot-room")).to_be_focused()
        front_page.keyboard.press("d")
        expect(front_page.locator("[data-hint]")).to_have_text("You drive it now.")
        front_page.evaluate("document.activeElement.blur()")


def test_space_is_the_emergency_stop_and_does_not_scroll(front_page: Page) -> None:
    wait(front_page, "now.left_speed > 1000")
    front_page.locator(".robot-room").focus()
    place = front_page.evaluate("window.scrollY")
    hint = front_page.locator("[data-hint]")
    expect(hint).to_have_text("It drives itself until you do.")
    front_page.keyboard.press("Space")
    wait(front_page, "now.state === 'FAULT' && now.fault === 'E_STOP' && now.left_pwm === 0")
    assert front_page.evaluate("window.scrollY") == place
    expect(hint).to_have_text("The firmware stopped the motors. Press “Clear the fault”, then drive on.")
    expect(front_page.locator("[data-how]")).to_be_hidden()
    front_page.get_by_role("button", name="Clear the fault", exact=True).click()
    wait(front_page, "now.state === 'DISARMED'")
    expect(hint).to_have_text("Fault cleared: the robot arms when you drive.")
    expect(front_page.locator("[data-how]")).to_be_visible()
    front_page.keyboard.down("d")
    expect(hint).to_have_text("You drive it now.")
    wait(front_page, "now.state === 'CLOSED_LOOP'")
    front_page.keyboard.up("d")
    front_page.get_by_role("button", name="Emergency stop").click()
    wait(front_page, "now.fault === 'E_STOP'")


def test_gains_hold_the_speed_against_friction_and_can_be_reset(front_page: Page) -> None:
    wait(front_page, "true")
    for gain in ("kp", "ki"):
        front_page.locator(f"[data-gain={gain}]").fill("0")
    front_page.locator(".robot-room").focus()
    front_page.keyboard.down("a")
    wait(front_page, "now.left_setpoint < -4700")
    front_page.wait_for_timeout(1000)
    wait(front_page, "now.left_setpoint < -4700 && now.left_speed > -3000 && now.left_pwm < 0")
    front_page.get_by_role("button", name="Reset gains").click()  # takes the focus: the key is released
    expect(front_page.locator("[data-gain=kp]")).to_have_value(str(KP.default))
    front_page.locator(".robot-room").focus()
    front_page.keyboard.up("a")
    front_page.keyboard.down("a")
    wait(front_page, "now.left_speed < -4000")
    front_page.keyboard.up("a")


def test_finger_on_the_stick_drives(front_page: Page) -> None:
    front_page.set_viewport_size({"width": 390, "height": 844})
    stick = front_page.locator(".robot-stick")
    stick.scroll_into_view_if_needed()
    box = stick.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = front_page.context.new_cdp_session(front_page)
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y + 5}]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y + 50}]})
    wait(front_page, "now.left_speed < -3000 && now.right_speed < -3000")
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    wait(front_page, "now.left_speed === 0 && now.right_speed === 0")
    assert front_page.evaluate("document.documentElement.scrollWidth") <= 390


def test_slider_sets_the_gain_in_the_board(front_page: Page) -> None:
    wait(front_page, "true")
    front_page.locator("[data-gain=kp]").fill("20.5")
    answer = front_page.evaluate(
        """() => new Promise((resolve) => {
          const { simulation } = document.getElementById("robot");
          const index = simulation.protocol.parameters.findIndex((one) => one.name === "kp");
          simulation.onMessage = (name, fields) => name === "parameter_value" && resolve([index, fields]);
          simulation.link.request("get_parameter", { index });
        })"""
    )
    index, fields = answer
    assert fields["index"] == index
    assert fields["value"] == round(20.5 * KP.scale)


def test_page_says_that_the_cable_is_out_while_the_robot_is_disarmed(front_page: Page) -> None:
    chip = front_page.locator("[data-chip=state]")
    wait(front_page, "true")
    front_page.evaluate(
        """() => {
          const { simulation } = document.getElementById("robot");
          simulation.twist = { v_m_s: 0, w_rad_s: 0 };
          simulation.link.command("DISARM");
        }"""
    )
    expect(chip).to_have_text("disarmed", timeout=MOTION_MS)
    front_page.get_by_role("button", name="Unplug the cable for 1 s").click()
    expect(chip).to_have_text("no link")
    hint = front_page.locator("[data-hint]")
    expect(hint).to_have_text("Cable unplugged: the motors were off, so nothing stops.")
    expect(chip).to_have_text("disarmed", timeout=MOTION_MS)
    expect(front_page.locator(".robot-fault")).to_be_hidden()


@pytest.mark.parametrize(
    ("button", "fault"),
    some_of(
        [
            ("cut", "STALL_LEFT"),
            ("unplug", "LINK_LOST"),
            ("block", "STALL_RIGHT|OVER_CURRENT"),  # both within 0.3 s; the duty decides which one is first
            ("drain", "LOW_BATTERY"),
        ],
    ),
)
def test_supervisor_stops_the_robot_and_the_page_names_the_fault(
    front_page: Page, button: str, fault: str
) -> None:
    wait(front_page, "now.left_speed > 3000 && now.right_speed > 3000")
    expect(front_page.locator(".robot-fault")).to_be_hidden()
    front_page.locator(f"[data-break={button}]").click()
    if button == "unplug":
        hint = "Cable unplugged: without commands the firmware stops the motors after 0.3 s."
        expect(front_page.locator("[data-hint]")).to_have_text(hint)
    wait(front_page, f"now.state === 'FAULT' && /^({fault})$/.test(now.fault)")
    names = "|".join(FAULT_NAMES[Fault[name]] for name in fault.split("|"))
    expect(front_page.locator(".robot-fault b")).to_have_text(re.compile(f"^({names})$"))
    expect(front_page.locator(".robot-fault")).to_be_visible()
    wait(
        front_page,
        "now.left_pwm === 0 && now.right_pwm === 0 && now.left_speed === 0 && now.right_speed === 0",
    )

    front_page.get_by_role("button", name="Repair").click()
    if button == "drain":  # the filtered voltage rises slowly
        expect(front_page.get_by_role("button", name="Clearing")).to_be_disabled()
    expect(front_page.locator(".robot-fault")).to_be_hidden()
    front_page.keyboard.down("s")
    wait(front_page, "now.left_speed < -1000 && now.right_speed < -1000")
    front_page.keyboard.up("s")


@pytest.mark.parametrize(
    ("button", "hint"),
    [("cut", "Left encoder wire cut: now drive."), ("block", "Right wheels blocked: now drive.")],
)
def test_page_shows_what_is_broken_while_the_robot_stands(front_page: Page, button: str, hint: str) -> None:
    wait(front_page, "true")
    line, key = front_page.locator("[data-hint]"), front_page.locator(f"[data-break={button}]")
    front_page.locator(".robot-room").focus()
    front_page.keyboard.press("d")
    expect(line).to_have_text("You drive it now.")
    wait(front_page, "now.left_setpoint === 0 && now.left_speed === 0 && now.right_speed === 0")
    expect(key).to_have_attribute("aria-pressed", "false")
    for _ in range(2):
        key.click()
        expect(key).to_have_attribute("aria-pressed", "true")
        expect(line).to_have_text(hint)
        key.click()
        expect(key).to_have_attribute("aria-pressed", "false")
        expect(line).to_have_text("You drive it now.")
    assert front_page.evaluate("document.getElementById('robot').simulation.newest.fault") == "NONE"


def test_page_says_in_a_contact_that_the_wheels_slip(front_page: Page) -> None:
    wait(front_page, "true")
    line = front_page.locator("[data-hint]")
    front_page.evaluate(
        """() => {
          const { simulation } = document.getElementById("robot");
          simulation.robot.drive.pose = { x_m: 5.4, y_m: 2.4, yaw_rad: 0 };
          simulation.twist = { v_m_s: 0, w_rad_s: 0 };
        }"""
    )
    front_page.locator(".robot-room").focus()
    front_page.keyboard.down("w")
    expect(line).to_have_text("You drive it now.")
    wait(front_page, "at.x_m > 5.7")
    hint = r"Contact: .* \(dashed outline\) run on\. (Back off with S|Pull the stick back)\."
    expect(line).to_have_text(re.compile(hint))
    front_page.keyboard.up("w")
    expect(line).to_have_text("You drive it now.")
    assert front_page.evaluate("document.getElementById('robot').simulation.pose.x_m") > 5.7


def test_emergency_stop_differs_from_the_buttons_that_break_something(front_page: Page) -> None:
    width = "(button) => button.getBoundingClientRect().width"
    colour = "(button) => getComputedStyle(button).color"
    stop = front_page.get_by_role("button", name="Emergency stop")
    others = front_page.locator("[data-break]").all()
    assert others
    assert all(stop.evaluate(width) > 1.9 * one.evaluate(width) for one in others)
    assert stop.evaluate(colour) not in [one.evaluate(colour) for one in others]


def test_button_back_to_top_covers_no_part_of_the_fault_on_a_phone(front_page: Page) -> None:
    front_page.set_viewport_size({"width": 390, "height": 844})
    front_page.locator(".robot-room").scroll_into_view_if_needed()
    wait(front_page, "true")
    front_page.get_by_role("button", name="Emergency stop").click()
    box = front_page.locator(".robot-fault")
    expect(box).to_be_visible()
    place = front_page.evaluate("window.scrollY")
    front_page.mouse.move(195, 300)
    front_page.mouse.wheel(0, 200)
    front_page.wait_for_function("place => window.scrollY === place + 200", arg=place)
    front_page.mouse.wheel(0, -60)  # the theme shows its button on the way up
    expect(front_page.locator(".md-top:not([hidden])")).to_have_count(1)
    covered = box.evaluate(
        """(box) => {
          const { left, top, width, height } = box.getBoundingClientRect();
          const share = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
          return share.flatMap((x) => share.map((y) => [left + x * width, top + y * height]))
            .filter(([x, y]) => !box.contains(document.elementFromPoint(x, y)));
        }"""
    )
    assert covered == []


def test_button_back_to_top_covers_no_button_of_the_robot(front_page: Page) -> None:
    wait(front_page, "true")
    block = front_page.get_by_role("button", name="Block the right wheels")
    front_page.mouse.move(720, 300)
    top = block.evaluate("(one) => one.getBoundingClientRect().top + window.scrollY")
    front_page.evaluate("(top) => window.scrollTo(0, top - 834 + 60)", top)
    front_page.mouse.wheel(0, -60)  # the theme shows its button on the way up
    shown = front_page.locator(".md-top:not([hidden])")
    expect(shown).to_have_count(1)
    front_page.wait_for_function("(place) => Math.abs(window.scrollY - place) < 2", arg=top - 834)
    places = "[...document.querySelectorAll('#robot button')].filter((one) => one.checkVisibility())"
    covered = front_page.evaluate(
        f"""() => {places}.flatMap((one) => {{
          const {{ left, right, top, bottom }} = one.getBoundingClientRect();
          const points = [left + 4, (left + right) / 2, right - 4].map((x) => [x, (top + bottom) / 2]);
          const at = points.map(([x, y]) => document.elementFromPoint(x, y));
          return at.filter((found) => found?.closest(".md-top")).map(() => one.innerText);
        }})"""
    )
    assert covered == []


def test_without_npm_one_line_says_so(tmp_path: Path) -> None:
    commands = tmp_path / "bin"
    commands.mkdir()
    for name in ("bash", "sh", "env", "dirname", "realpath"):
        (commands / name).symlink_to(shutil.which(name) or pytest.fail(name))
    done = build_robot(tmp_path, PATH=str(commands))
    assert done.returncode == 0
    assert done.stderr == (
        "thumper: npm is missing and could not be installed; the site's front page has no robot\n"
    )
    assert not (tmp_path / "robot").exists()
