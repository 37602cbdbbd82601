"""Camera, GPS, IMU and detected objects on the page: each only if the robot has it."""

from benchmarks.shared.fake_robot import FakeRobot
from playwright.sync_api import Page, expect

MAP = "document.querySelector('.tp-map').mapView"
PARTS = (".tp-header .tp-of-gps", ".tp-panels .tp-of-gps", ".tp-panels .tp-of-imu", ".tp-camera")


def figures(page: Page, *names: str) -> list[str]:
    return [page.locator(f".tp-figures [data-field={name}]").inner_text() for name in names]


def test_a_robot_without_sensors_shows_none(page: Page) -> None:
    page.click(".tp-tab-system")
    expect(page.locator("[data-field=telemetry_age]")).to_be_visible()
    for part in PARTS:
        expect(page.locator(part)).to_be_hidden()
    page.click("[data-tool=layers]")
    expect(page.locator("[data-layer=scan]")).to_be_visible()
    expect(page.locator("[data-layer=gps]")).to_be_hidden()


def test_sensors_are_shown_until_the_robot_restarts_without_them(page: Page, robot: FakeRobot) -> None:
    robot.has_sensors = True
    expect(page.locator(".tp-header [data-field=gps_fix]")).to_have_text("RTK fix 0.02 m")
    frame = page.locator(".tp-camera img")
    expect(frame).to_be_visible()
    page.wait_for_function("document.querySelector('.tp-camera img').naturalWidth === 64")
    page.click(".tp-tab-system")
    expect(page.locator("[data-field=imu_rate]")).to_have_text("14.3°/s")
    assert figures(page, "imu_roll", "imu_pitch", "imu_acceleration") == ["0.0°", "5.7°", "0.0, 0.2, 9.8"]
    place = ["48.2625018°", "11.6681078°", "525.90 m"]
    assert figures(page, "gps_latitude", "gps_longitude", "gps_altitude") == place
    page.wait_for_function(f"{MAP}.data.gps.length > 10")
    distance_m = page.evaluate(f"{MAP}.data.gps.at(-2) - {MAP}.pose[0]")
    assert abs(distance_m - 0.1) < 0.03  # the antenna is 0.1 m beside it; one cycle moves 0.02 m
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    header = page.locator(".tp-header")
    assert header.evaluate("header => header.scrollWidth <= header.clientWidth")  # nothing is cut
    page.set_viewport_size({"width": 1440, "height": 900})
    robot.has_sensors = False
    expect(page.locator(".tp-header [data-field=gps_fix]")).to_have_text("no data")
    page.click(".tp-tab-drive")
    expect(page.locator("[data-field=camera_age]")).to_contain_text("no frame for")
    robot.lidar_scans = 3
    expect(page.locator(".tp-header .tp-of-gps")).to_be_hidden()
    expect(page.locator(".tp-camera")).to_be_hidden()
    page.wait_for_function("thumper.state.values.objects.length === 0")


def test_a_detected_object_is_drawn_with_its_label(page: Page, robot: FakeRobot) -> None:
    page.evaluate(
        """() => {
          const draw = CanvasRenderingContext2D.prototype.fillText;
          window.texts = new Map();
          CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
            window.texts.set(text, [x, y]);
            draw.call(this, text, x, y);
          };
        }"""
    )
    robot.has_sensors = True
    page.wait_for_function("window.texts.has('chair')")
    at_px = page.evaluate("window.texts.get('chair')")
    assert at_px == page.evaluate(f"(([x, y]) => [x, y + 22])({MAP}.camera.toScreen(1.0, 0.5))")
    page.click("[data-tool=layers]")
    page.locator("[data-layer=annotations]").uncheck()
    page.evaluate(f"window.texts.clear(), {MAP}.redraw()")
    page.wait_for_function("window.texts.size > 0")  # another frame has been drawn
    assert not page.evaluate("window.texts.has('chair')")
