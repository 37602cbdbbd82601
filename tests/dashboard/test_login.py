"""Who may come in: loopback, password, HTTPS, same page."""

import asyncio
import http.client
import ssl
import stat
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlencode

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidHandshake, WebSocketException

from tests.dashboard.conftest import Server
from tests.dashboard.fake_robot import FakeRobot
from thumper.common.errors import ThumperError
from thumper.config.dashboard import DashboardOptions, checked
from thumper.dashboard.certificate import make_certificate, own_names

PASSWORD = "correct horse"
PATIENCE_S = 60.0  # it listens before it has imported what answers


def test_loopback_needs_nothing() -> None:
    listening = checked(DashboardOptions())
    assert (listening.url, listening.secure) == ("http://localhost:8080/", False)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::", "robot.local"])
def test_leaving_the_machine_needs_password_and_https(
    host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    with pytest.raises(ThumperError, match="password"):
        checked(DashboardOptions(host=host))
    with pytest.raises(ThumperError, match="password"):
        checked(DashboardOptions(host=host, password="short"))
    with pytest.raises(ThumperError, match="HTTPS"):
        checked(DashboardOptions(host=host, password=PASSWORD))
    certificate, key = tmp_path / "a.crt", tmp_path / "a.key"
    make_certificate(certificate, key, own_names(host))
    options = DashboardOptions(host=host, password=PASSWORD, certificate=str(certificate), key=str(key))
    assert checked(options).secure


def test_refusal_is_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "thumper", "dashboard", "--host", "0.0.0.0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("thumper: the dashboard would be open to everybody")
    assert done.stderr.count("\n") == 1


def test_a_certificate_is_made_once(tmp_path: Path) -> None:
    certificate, key = tmp_path / "x" / "a.crt", tmp_path / "x" / "a.key"
    make_certificate(certificate, key, ["localhost", "127.0.0.1"])
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    for other in (certificate, key):
        other.unlink()
        with pytest.raises(ThumperError, match="there already"):
            make_certificate(certificate, key, ["localhost"])
        assert not other.exists()
        other.touch()


def status(server: Server, path: str = "/", **headers: str) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={"Host": f"localhost:{server.port}", **headers})
    return connection.getresponse().status


def refused(url: str, origin: str | None, context: ssl.SSLContext | None = None) -> bool:
    async def knock() -> bool:
        try:
            patient = connect(url, origin=origin, ssl=context, open_timeout=PATIENCE_S)  # type: ignore[arg-type]
            async with patient as socket:
                await socket.recv()
        except (InvalidHandshake, WebSocketException):
            return True
        return False

    return asyncio.run(knock())


def test_other_pages_stay_outside(server: Server) -> None:
    assert status(server) == 200
    assert status(server, Host="evil.example") == 403  # a name that was pointed at this machine
    assert status(server, Origin="http://evil.example") == 403
    assert status(server, Host="[") == status(server, Origin="http://[") == 403  # no address at all
    stream = f"ws://127.0.0.1:{server.port}/stream"
    assert refused(stream, "http://evil.example")
    assert not refused(stream, f"http://127.0.0.1:{server.port}")


def test_floods_and_nonsense_do_not_pass(server: Server, robot: FakeRobot) -> None:
    async def flood() -> str:
        async with connect(f"ws://127.0.0.1:{server.port}/stream", open_timeout=PATIENCE_S) as socket:
            for _ in range(300):
                await socket.send('{"kind": "command", "name": "arm"}')
            await socket.send("x" * 9000)
            try:
                while True:
                    await socket.recv()
            except WebSocketException as error:
                return str(error)

    robot.reset()
    assert "too long" in asyncio.run(flood())
    assert len(robot.asked) < 100


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
        connection = http.client.HTTPSConnection(
            "localhost", server.port, timeout=PATIENCE_S, context=context
        )
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
