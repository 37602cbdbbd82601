"""The page in a real browser: what it shows of the robot."""

import re
from typing import Literal

import pytest
from benchmarks.shared.browser import Server, open_page
from benchmarks.shared.fake_robot import FakeRobot
from benchmarks.shared.live import until
from playwright.sync_api import Browser, Page, expect

from tests.page_checks import DESK, PHONE, POOR, TABLET
from thumper.board.messages import Fault, State
from thumper.common.geometry import Pose2
from thumper.dashboard.page import page_title
from thumper.runtime.requests import Query, SetPose

NUMBER = re.compile(r"^-?\d+\.\d\d$")


def test_robot_data_is_drawn(page: Page) -> None:
    expect(page.locator("#tp-banner")).to_have_text("Simulated robot: Laboratory")
    expect(page.locator(".tp-battery [data-field=battery]")).to_have_text("7.62 V")
    page.wait_for_function("document.querySelector('.tp-map').mapView.data.scan.length > 1000")
    points = page.evaluate("Array.from(document.querySelector('.tp-map').mapView.data.scan)")
    for x_m, y_m in zip(points[::2], points[1::2], strict=True):  # on a wall of the room, as drawn
        assert min(abs(x_m), abs(x_m - 4.0), abs(y_m), abs(y_m - 3.0)) < 0.08
    wall, free = page.evaluate("""() => {
      const { canvas } = document.querySelector('.tp-map').mapView.grids.map;
      const pixel = (column, row) => Array.from(
        canvas.getContext('2d').getImageData(column, canvas.height - 1 - row, 1, 1).data);
      return [pixel(65, 54), pixel(20, 54)];
    }""")
    assert wall == [27, 39, 51, 255]  # the box of the room is where the grid has it, and not upside down
    assert free == [251, 252, 253, 255]
    page.wait_for_function("document.querySelector('.tp-wheels').charts.rows.length > 5")


def test_status_names_the_experiment_that_drives(page: Page, robot: FakeRobot) -> None:
    mode = page.locator("[data-field=mode]")
    expect(mode).to_have_text("idle")
    robot.experiment = "tune"
    expect(mode).to_have_text("tuning wheels")
    expect(page.locator("[data-field=reason]")).to_have_text("step 3")
    page.click(".tp-tab-tune")
    expect(page.locator(".tp-tune .tp-message")).to_have_text("20 %, about 80 s left: step 3")
    robot.experiment = ""
    expect(mode).to_have_text("idle")


def test_the_result_of_an_experiment_is_above_its_lines(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-tune")
    robot.experiment_result = "the board uses the new gains"
    expect(page.locator(".tp-tune .tp-message")).to_have_text("the board uses the new gains")
    expect(page.locator(".tp-lines div")).to_have_text(["left: 3 rad/s"])
    expect(page.locator(".tp-lines")).to_be_visible()
    robot.experiment_lines = tuple(f"line {number}" for number in range(18))
    expect(page.locator(".tp-lines div")).to_have_count(18)
    expect(page.locator(".tp-lines")).to_be_hidden()
    page.get_by_text("Details", exact=True).click()
    expect(page.locator(".tp-lines")).to_be_visible()
    page.wait_for_timeout(600)  # more states arrive
    expect(page.locator(".tp-lines")).to_be_visible()


def test_lost_pose_is_shown_with_its_reason(page: Page, robot: FakeRobot) -> None:
    pose, reason = page.locator("[data-field=pose]"), page.locator("[data-field=reason]")
    expect(pose).to_contain_text(" m")
    robot.pose_lost, robot.localization = "several places look alike", "pose lost"
    expect(pose).to_have_text("lost")
    expect(reason).to_have_text("pose lost: several places look alike")
    view = "document.querySelector('.tp-map').mapView"
    points, x_m = page.evaluate(f"[{view}.data.trail.length, {view}.pose[0]]")
    page.wait_for_function(f"Math.abs({view}.pose[0] - {x_m}) > 0.1")
    assert page.evaluate(f"{view}.data.trail.length") == points  # guesses are no path
    robot.pose_lost = ""
    expect(pose).to_contain_text(" m")


def test_header_shows_the_state_of_localization(page: Page, robot: FakeRobot) -> None:
    chip, notice = page.locator(".tp-header .tp-localization"), page.locator(".tp-notice")
    expect(chip).to_contain_text("mapping")
    expect(page.locator(".tp-lost")).to_be_hidden()
    robot.pose_lost, robot.localization = "the whole map is searched for the pose", "searching"
    expect(chip).to_contain_text("searching")
    expect(page.locator("[data-field=reason]")).to_have_text(
        "searching: the whole map is searched for the pose"
    )
    expect(page.locator(".tp-lost")).to_contain_text("searching for the pose")
    expect(notice).to_have_count(0)
    robot.pose_lost, robot.localization = "", "localized"
    expect(chip).to_contain_text("localized")
    expect(notice).to_have_text("pose found: the robot is localized in the map")
    robot.pose_lost, robot.localization = "the map explains only 12 % of the scan", "pose lost"
    expect(chip).to_have_css("background-color", "rgb(207, 34, 46)")
    expect(page.locator("[data-field=reason]")).to_have_text(
        "pose lost: the map explains only 12 % of the scan"
    )
    expect(notice).to_have_count(0, timeout=3_000)  # the line says it; the one before is true no longer
    page.reload()
    expect(page.locator(".tp-lost")).to_be_visible()
    expect(notice).to_have_count(0)  # the state has not changed


def test_page_of_a_robot_that_lost_its_pose_says_how_to_set_it(page: Page, robot: FakeRobot) -> None:
    robot.pose_lost, robot.localization = "carried away", "pose lost"
    box, tool = page.locator(".tp-lost"), page.locator(".tp-toolbar [data-tool=pose]")
    expect(box).to_contain_text("To set the pose, press on the map where the robot is")
    expect(tool).not_to_have_css("box-shadow", "none")
    box.get_by_role("button", name="Search the map").click()
    until(lambda: {"command": "relocalize"} in [query.content for query in robot.received_of(Query)])
    box.get_by_role("button", name="Set pose").click()
    expect(tool).to_have_class("on")
    expect(box.get_by_role("button")).to_have_count(0)  # the sentence stays, and lets clicks through
    place = box.bounding_box()
    assert place is not None
    page.mouse.click(place["x"] + 20, place["y"] + 20)
    until(lambda: robot.received_of(SetPose))
    robot.localization = "pose lost while mapping"  # then the map takes no pose
    expect(box).to_be_hidden()
    expect(page.locator(".tp-localization")).to_contain_text("pose lost")


def test_fault_is_shown_with_its_fix(page: Page, robot: FakeRobot) -> None:
    robot.fault_words = "stall left"
    robot.fault_cure = "the left wheels do not turn; are they blocked?"
    robot.fault, robot.battery_V = Fault.STALL_LEFT, 6.9
    expect(page.locator(".tp-fault-words")).to_have_text("stall left")
    expect(page.locator(".tp-fault-cure")).to_have_text(robot.fault_cure)
    robot.simulated_faults["slip.left"] = 0.5
    injected = page.locator(".tp-fault-injected")
    expect(injected).to_have_text("Simulated faults: Left wheels: slip (slip.left) 0.5 (tab Sim)")
    expect(page.locator(".tp-battery")).to_have_css("background-color", "rgb(207, 34, 46)")


def test_empty_log_says_so(page: Page) -> None:
    page.click(".tp-tab-log")
    page.locator(".q-tab-panel > .tp-log").evaluate("log => log.replaceChildren()")  # events of other tests
    text = "getComputedStyle(document.querySelector('.q-tab-panel > .tp-log'), '::before').content"
    page.wait_for_function(f"{text} === '\"No events yet.\"'")


def test_log_has_lines_from_before_its_tab_opened(page: Page, robot: FakeRobot) -> None:
    robot.event("a wheel slips")
    robot.fault_words = robot.fault_cure = "stall left"
    robot.fault = Fault.STALL_LEFT
    expect(page.locator(".tp-fault-words")).to_have_text("stall left")
    page.click(".tp-tab-log")
    expect(page.locator(".tp-logline:visible", has_text="a wheel slips")).to_be_visible()


def test_the_drive_tab_shows_as_many_new_events_as_there_is_room_for(page: Page, robot: FakeRobot) -> None:
    newest = page.locator(".tp-newest .tp-logline")
    for number in range(25):
        robot.event(f"event {number}")
        expect(newest.first).to_contain_text(f"event {number}")  # the bus drops what comes at once
    expect(newest.first).to_be_in_viewport(ratio=1.0)
    expect(newest.nth(8)).to_be_in_viewport(ratio=1.0)
    expect(newest.nth(24)).not_to_be_in_viewport()
    assert page.locator(".tp-panels").evaluate("one => one.scrollHeight <= one.clientHeight")
    page.set_viewport_size(PHONE)  # the tab Log shows them
    expect(page.locator(".tp-newest")).to_be_hidden()


def test_slow_page_shows_no_log_line_twice(browser: Browser, server: Server, robot: FakeRobot) -> None:
    """A page that has fallen behind receives a full packet, as a new page does."""
    robot.event("a wheel slips again")
    page = browser.new_page()
    page.add_init_script("""window.WebSocket = class extends WebSocket {
      constructor(...how) {
        super(...how);
        this.addEventListener("message", (event) => {
          if (typeof event.data !== "string") window.fallBehind ??= () => this.onmessage(event);
        });
      }
    };""")
    open_page(page, server)
    page.click(".tp-tab-log")
    line = page.locator(".tp-logline:visible", has_text="a wheel slips again")
    expect(line).to_have_count(1)
    page.evaluate("fallBehind()")
    expect(line).to_have_count(1)
    page.evaluate("fallBehind()")
    expect(line).to_have_count(1)
    page.close()


def test_the_speed_of_the_simulation_is_marked(page: Page) -> None:
    page.click(".tp-tab-sim")
    marked = page.locator("button[aria-pressed=true]:visible")
    expect(marked).to_have_text("1x")
    page.get_by_role("button", name="5x", exact=True).click()
    expect(marked).to_have_text("5x")


def test_another_simulated_world_is_chosen_in_the_panel(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-sim")
    world = page.locator(".tp-faultrow .q-select", has_text="World")
    expect(world).to_contain_text("Laboratory: one room")
    world.click()
    page.get_by_role("option", name="Hall: empty", exact=True).click()
    banner = page.locator("#tp-banner")
    expect(banner).to_have_text("Simulated robot: Laboratory")
    page.click("text=Start in this world")
    expect(page.locator(".tp-message:visible")).to_have_text("the robot starts again in the world hall")
    assert robot.simulated_world == "hall"
    expect(banner).to_have_text("Simulated robot: Hall")


def test_banner_says_that_the_robot_restarts_in_another_world(
    page: Page, robot: FakeRobot, server: Server
) -> None:
    banner = page.locator("#tp-banner")
    robot.event("the robot starts again in the world Hall, with a new map")
    page.wait_for_function("sessionStorage.getItem('tp-restart')")
    expect(banner).to_have_text("Simulated robot: Laboratory")  # it still saves its map
    page.evaluate("window.isBeforeRestart = true")
    server.kill()
    try:
        expect(banner).to_have_text("The robot restarts in the world Hall …")
    finally:
        server.start()
    page.wait_for_function("!window.isBeforeRestart")  # loaded again: offline, it could not
    expect(banner).to_have_text("Simulated robot: Laboratory")
    page.context.set_offline(True)
    expect(banner).to_contain_text("No connection")


def test_active_faults_are_shown_on_every_page(page: Page, robot: FakeRobot) -> None:
    robot.simulated_faults["slip.left"] = 0.5  # by another client
    page.click(".tp-tab-sim")
    expect(page.locator(".tp-active-faults")).to_have_text("Active faults: Left wheels: slip (slip.left) 0.5")
    page.locator(".tp-faultrow .q-select", has_text="Fault").click()
    expect(page.locator(".q-menu .q-item")).to_have_text(
        ["Lidar: plug (lidar)", "Left wheels: slip (slip.left)", "Robot: carried away (robot.carried)"]
    )
    page.locator(".q-menu >> text=Lidar: plug").click()
    expect(page.locator(".tp-faultrow .q-select", has_text="Kind")).to_contain_text("unplugged")  # not ok
    page.click("text=Apply fault")
    active = "Active faults: Left wheels: slip (slip.left) 0.5, Lidar: plug (lidar) unplugged"
    expect(page.locator(".tp-active-faults")).to_have_text(active)
    page.reload()
    page.click(".tp-tab-sim")
    expect(page.locator(".tp-active-faults")).to_have_text(active)
    page.click("text=Remove all faults")
    expect(page.locator(".tp-active-faults")).to_have_text("Active faults: none")
    expect(page.get_by_role("button", name="Remove all faults")).to_be_hidden()
    assert robot.simulated_faults == {}


def test_only_a_fault_that_lasts_says_how_it_ends(page: Page, robot: FakeRobot) -> None:
    page.click(".tp-tab-sim")
    faults = page.locator(".tp-faultrow .q-select", has_text="Fault")
    hint = page.locator(".tp-hint:visible")

    def choose(title: str) -> None:
        faults.click()
        page.get_by_role("option", name=title).click()

    expect(hint).to_have_text("It stays active until you set it to ok.")
    choose("Left wheels: slip")
    expect(hint).to_have_text("It stays active until you set it to 0.")
    choose("Robot: carried away")
    expect(hint).to_have_count(0)
    pose = page.get_by_label("x [m], y [m], heading [°]")
    expect(pose).to_have_attribute("placeholder", "1.0, 0.5, 90")
    page.click("text=Apply fault")
    field = page.locator(".tp-faultrow .q-input", has_text="heading")
    expect(field).to_contain_text("enter three numbers, for example 1.0, 0.5, 90")
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(500)  # Quasar fades the message
    assert page.evaluate(POOR) == []
    pose.fill("1, 2, 90")
    page.click("text=Apply fault")
    expect(page.locator(".tp-message:visible")).to_have_text("robot.carried is [1.0, 2.0, 90.0]")
    expect(field).not_to_contain_text("enter three")


def test_trail_is_cleared_by_a_new_map(page: Page, robot: FakeRobot) -> None:
    length = "document.querySelector('.tp-map').mapView.data.trail.length"
    page.wait_for_function(f"{length} > 8")
    before = page.evaluate(length)
    robot.lidar_scans = 3
    page.wait_for_function(f"{length} < {before}")


def test_the_trail_outlives_a_reload(page: Page) -> None:
    length = "document.querySelector('.tp-map')?.mapView?.data.trail.length"
    page.wait_for_function(f"{length} > 60")
    page.reload()
    page.wait_for_function(f"{length} > 0")
    assert page.evaluate(length) > 40


def test_a_notice_goes_when_it_is_true_no_longer(page: Page) -> None:
    page.click(".tp-estop")
    page.click("text=Clear fault")
    notices = page.locator(".tp-notice")
    expect(notices).to_have_text(["fault cleared; the motors are off"])
    page.click(".tp-arm")
    expect(notices).to_have_text(["armed; the wheels hold still"])
    page.click(".tp-estop")
    expect(page.locator(".tp-fault")).to_be_visible()
    expect(notices).to_have_count(0, timeout=2_000)  # by itself it would stay for 4 s


def test_the_notice_of_a_saved_map_replaces_the_one_of_its_start(page: Page, robot: FakeRobot) -> None:
    notices = page.locator(".tp-notice")
    page.evaluate(
        """async () => {
          const { notify } = await import("thumper-dashboard/commands.js");
          notify("saving the map to a.yaml", "good");
        }"""
    )
    expect(notices).to_have_text(["saving the map to a.yaml"])
    robot.event("map saved: a.yaml")
    expect(notices).to_have_text(["map saved: a.yaml"], timeout=2_000)  # by itself it would stay for 4 s


def test_a_notice_does_not_repeat_the_line_below_the_map(page: Page, robot: FakeRobot) -> None:
    explored = "explored after 9 s: reached 2 of 2 frontiers; back at the start"
    notices = page.locator(".tp-notice")
    robot.event(explored)
    expect(notices).to_have_text([explored])
    robot.reason = explored
    expect(notices).to_have_count(0, timeout=2_000)  # by itself it would stay for 4 s
    page.set_viewport_size({"width": 390, "height": 500})
    page.locator(".tp-charts > div").last.scroll_into_view_if_needed()
    robot.event(explored)
    page.wait_for_timeout(500)
    expect(notices).to_have_text([explored])  # the line is out of view


def test_charts_freeze_and_export_csv(page: Page) -> None:
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


def test_motor_pwm_has_no_setpoint(page: Page, robot: FakeRobot) -> None:
    setpoint = page.locator(".tp-charthead span", has_text="set-point").locator("output").first
    speed = page.locator(".tp-charthead span", has_text="speed").locator("output").first
    expect(setpoint).to_have_text(NUMBER)
    robot.state = State.MANUAL
    expect(setpoint).to_have_text("\u2013")
    expect(speed).to_have_text(NUMBER)
    robot.state = State.CLOSED_LOOP
    expect(setpoint).to_have_text(NUMBER)


def test_real_robot_has_its_banner(page: Page, robot: FakeRobot) -> None:
    robot.simulated = False
    try:
        expect(page.locator("#tp-banner")).to_have_text("Real robot: it can move at any time")
        expect(page.locator(".tp-tab-sim")).to_be_hidden()
    finally:
        robot.simulated = True


LANE = """() => {
  const { context } = document.querySelector('.tp-map').mapView;
  const drawn = [];
  context.strokeRect = (x, y, width, height) => drawn.push([width, height]);
  document.querySelector('.tp-map').mapView.draw();
  delete context.strokeRect;
  const { scale } = document.querySelector('.tp-map').mapView.camera;
  return drawn.map((size) => size.map((pixels) => Math.round(100 * pixels / scale) / 100));
}"""


def test_the_map_shows_the_lane_that_tuning_needs(page: Page) -> None:
    assert page.evaluate(LANE) == []
    page.click(".tp-tab-tune")
    expect(page.locator(".tp-lane")).to_be_visible()
    assert page.evaluate(LANE) == [[2.4, 0.8]]
    page.fill(".tp-lane", "0.8")
    assert page.evaluate(LANE) == [[1.6, 0.8]]
    page.click(".tp-tab-drive")
    expect(page.locator(".tp-lane")).to_be_hidden()
    assert page.evaluate(LANE) == []


def test_the_goal_tool_says_that_it_arms_the_motors(page: Page, robot: FakeRobot) -> None:
    goal, hint = page.locator("[data-tool=goal]"), page.locator(".tp-toolname")
    goal.click()
    expect(hint).to_be_hidden()  # the motors are on
    expect(goal).not_to_have_attribute("title", re.compile("arms"))
    robot.state = State.DISARMED
    for size in (DESK, TABLET, PHONE):
        page.set_viewport_size(size)
        expect(hint).to_be_visible()
        expect(hint).to_have_text("Goal: this arms the motors")
    expect(goal).to_have_attribute("title", re.compile("set the heading; this arms the motors"))


def test_stop_removes_the_plan(page: Page, robot: FakeRobot) -> None:
    planned = """() => {
      const { canvas, context } = document.querySelector('.tp-map').mapView;
      const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
      let count = 0;
      for (let k = 0; k < data.length; k += 4) {
        count += data[k] === 194 && data[k + 1] === 65 && data[k + 2] === 12;
      }
      return count;
    }"""
    robot.goal = Pose2(x_m=1.0, y_m=1.0)
    page.wait_for_function(f"({planned})() > 50")
    page.click(".tp-estop")
    page.wait_for_function(f"({planned})() === 0")
    page.click("text=Clear fault")
    assert page.evaluate(f"({planned})()") == 0


def test_colours_show_whether_the_motors_are_on(page: Page, robot: FakeRobot) -> None:
    arm, disarm, chip = page.locator(".tp-arm"), page.locator(".tp-disarm"), page.locator(".tp-board")
    plain, green, grey = "rgba(0, 0, 0, 0)", "rgb(26, 127, 55)", "rgb(243, 245, 248)"
    amber, red = "rgb(154, 103, 0)", "rgb(207, 34, 46)"

    def expect_colours(text: str, colours: tuple[str, str, str], *, armed: bool) -> None:
        expect(chip).to_contain_text(text)
        for element, colour in zip((chip, arm, disarm), colours, strict=True):
            expect(element).to_have_css("background-color", colour)
        expect(arm).to_have_attribute("aria-pressed", str(armed).lower())

    expect_colours("armed", (green, plain, amber), armed=True)
    robot.state = State.MANUAL
    expect_colours("armed", (green, plain, amber), armed=True)
    disarm.click()
    page.mouse.move(5, 5)  # a button below the mouse has another colour
    expect_colours("disarmed", (grey, green, plain), armed=False)
    page.click(".tp-estop")
    expect_colours("fault", (red, plain, plain), armed=False)
    page.click("text=Clear fault")
    expect_colours("disarmed", (grey, green, plain), armed=False)
    arm.click()
    expect_colours("armed", (green, plain, amber), armed=True)


def test_the_title_names_only_a_robot_that_has_a_name(page: Page) -> None:
    expect(page).to_have_title("Thumper")
    assert page_title("rover") == "rover · Thumper"


def test_the_costmap_fades_at_its_edge(page: Page) -> None:
    alphas = page.evaluate("""async () => {
      const view = document.querySelector('.tp-map').mapView;
      const grid = new view.grids.map.constructor('local_costmap');
      grid.clear({ rows: 60, columns: 80 });
      grid.cells.fill(101);
      grid.paint(0, 0, 60, 80);
      const { data } = grid.canvas.getContext('2d').getImageData(0, 30, 80, 1);
      return [0, 5, 40, 79].map((column) => data[4 * column + 3]);
    }""")
    assert 0 < alphas[0] < alphas[1] < alphas[2]
    assert alphas[3] == alphas[0]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_costmap_leaves_walls_as_they_are(page: Page, scheme: Literal["light", "dark"]) -> None:
    page.emulate_media(color_scheme=scheme)
    page.wait_for_function("document.querySelector('.tp-map').mapView.grids.map")
    wall, free, texts = page.evaluate("""async () => {
      const view = document.querySelector('.tp-map').mapView;
      const { info } = view.grids.map;
      const texts = [];
      view.context.fillText = (text) => texts.push(text);
      await view.grids.map.drawn;
      const canvas = document.createElement('canvas');
      Object.assign(canvas, { width: info.columns, height: info.rows });
      const pink = canvas.getContext('2d');
      pink.fillStyle = 'rgba(214, 51, 132, .5)';
      pink.fillRect(0, 0, info.columns, info.rows);
      for (const name of Object.keys(view.visible)) view.visible[name] = name === 'map';
      const ratio = window.devicePixelRatio;
      const colours = (...names) => {
        for (const name of names) view.visible[name] = true;
        view.grids.local_costmap = { canvas, info };
        view.draw();
        return [[65, 54], [20, 54]].map(([column, row]) => {
          const at = [column + 0.5, row + 0.5].map((cells, k) => info.origin[k] + cells * info.resolution_m);
          const [x, y] = view.camera.toScreen(...at).map((part) => Math.round(part * ratio));
          return Array.from(view.context.getImageData(x, y, 1, 1).data);
        });
      };
      const [without, painted] = [colours(), colours('local_costmap')];
      return [...[0, 1].map((k) => [without[k], painted[k]]), texts];
    }""")
    assert wall[0] == wall[1]
    assert free[0] != free[1]
    assert texts
    assert all(text.endswith(" m") for text in texts)  # the scale; Layers names the costmap, not the map
