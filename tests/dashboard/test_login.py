"""Access control: loopback, password, HTTPS, origin."""

import http.client
import ssl
import stat
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlencode

import pytest
from benchmarks.shared.browser import Server
from benchmarks.shared.fake_robot import FakeRobot
from websockets.exceptions import InvalidHandshake, WebSocketException
from websockets.sync.client import connect

from thumper.common.certificates import local_names
from thumper.common.errors import ThumperError
from thumper.config.dashboard import DashboardOptions, check_options
from thumper.dashboard.certificate import make_certificate

PASSWORD = "correct horse"
TIMEOUT_S = 60.0  # it listens before it has imported what answers


def test_loopback_needs_no_password() -> None:
    listening = check_options(DashboardOptions())
    assert (listening.url, listening.secure) == ("http://localhost:8080/", False)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "robot.local"])
def test_public_address_needs_password_and_https(
    host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(ThumperError, match="password"):
        check_options(DashboardOptions(host=host))
    with pytest.raises(ThumperError, match="password"):
        check_options(DashboardOptions(host=host, password="short"))
    with pytest.raises(ThumperError, match="HTTPS"):
        check_options(DashboardOptions(host=host, password=PASSWORD))
    certificate, key = tmp_path / "a.crt", tmp_path / "a.key"
    make_certificate(certificate, key, local_names(host))
    options = DashboardOptions(host=host, password=PASSWORD, certificate=str(certificate), key=str(key))
    assert check_options(options).secure


def test_refusal_is_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "thumper", "dashboard", "--host", "0.0.0.0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("thumper: anybody who can reach")
    assert done.stderr.count("\n") == 1


def test_existing_certificate_is_not_overwritten(tmp_path: Path) -> None:
    certificate, key = tmp_path / "x" / "a.crt", tmp_path / "x" / "a.key"
    make_certificate(certificate, key, ["localhost", "127.0.0.1"])
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    for other in (certificate, key):
        other.unlink()
        with pytest.raises(ThumperError, match="exists already"):
            make_certificate(certificate, key, ["localhost"])
        assert not other.exists()
        other.touch()


def status(server: Server, path: str = "/", **headers: str) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=TIMEOUT_S)
    connection.request("GET", path, headers={"Host": f"localhost:{server.port}", **headers})
    return connection.getresponse().status


def refused(url: str, origin: str | None, context: ssl.SSLContext | None = None) -> bool:
    try:
        connection = connect(url, origin=origin, ssl=context, open_timeout=TIMEOUT_S)  # type: ignore[arg-type]
        with connection as socket:
            socket.recv(timeout=TIMEOUT_S)
    except (InvalidHandshake, WebSocketException):
        return True
    return False


def test_other_origins_are_refused(server: Server) -> None:
    assert status(server) == 200
    assert status(server, Host="evil.example") == 403  # DNS rebinding
    assert status(server, Origin="http://evil.example") == 403
    assert status(server, Host="[") == status(server, Origin="http://[") == 403  # malformed
    stream = f"ws://127.0.0.1:{server.port}/stream"
    assert refused(stream, "http://evil.example")
    assert not refused(stream, f"http://127.0.0.1:{server.port}")


def test_floods_and_invalid_messages_are_dropped(server: Server, robot: FakeRobot) -> None:
    robot.reset()
    with connect(f"ws://127.0.0.1:{server.port}/stream", open_timeout=TIMEOUT_S) as socket:
        for _ in range(300):
            socket.send('{"kind": "command", "name": "arm"}')
        socket.send("x" * 9000)
        with pytest.raises(WebSocketException, match="too long"):
            list(socket)  # reads until the server closes
    assert len(robot.received) < 100


def test_password_over_https(robot: FakeRobot, tmp_path: Path) -> None:
    certificate, key, config = tmp_path / "a.crt", tmp_path / "a.key", tmp_path / "robot.toml"
    make_certificate(certificate, key, ["localhost"])
    config.write_text(
        f'[dashboard]\npassword = "{PASSWORD}"\ncertificate = "{certificate}"\nkey = "{key}"\n',
        encoding="utf-8",
    )
    server = Server(robot.address, tmp_path, "--config", str(config))
    context = ssl.create_default_context(cafile=str(certificate))

    def request(method: str, path: str, body: str = "", **headers: str) -> http.client.HTTPResponse:
        connection = http.client.HTTPSConnection("localhost", server.port, timeout=TIMEOUT_S, context=context)
        connection.request(method, path, body, {"Accept": "text/html", **headers})
        return connection.getresponse()

    try:
        answer = request("GET", "/")
        assert (answer.status, answer.headers["location"]) == (303, "/login")
        assert request("GET", "/_nicegui/anything", Accept="*/*").status == 401
        assert refused(f"wss://localhost:{server.port}/stream", None, context)
        assert request("POST", "/login", urlencode({"password": "wrong"})).status == 401
        answer = request("POST", "/login", urlencode({"password": PASSWORD}))
        cookie = answer.headers["set-cookie"]
        assert answer.status == 303
        assert all(word in cookie.lower() for word in ("httponly", "secure", "samesite=strict"))
        page = request("GET", "/", Cookie=cookie.partition(";")[0])
        assert page.status == 200
        assert "default-src 'self'" in page.headers["content-security-policy"]
        guesses = (request("POST", "/login", urlencode({"password": str(k)})).status for k in range(50))
        assert 429 in guesses
    finally:
        server.close()
