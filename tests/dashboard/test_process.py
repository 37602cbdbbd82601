"""`thumper run --ui` starts with its page or not at all."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.shared.live import free_port


@pytest.mark.parametrize("taken", ["page", "bus"])
def test_port_in_use_is_reported_before_the_robot_is_opened(taken: str, tmp_path: Path) -> None:
    ports = {"page": free_port(), "bus": free_port()}
    config = tmp_path / "robot.toml"
    config.write_text(
        f'[board]\nport = "/dev/ttyNONE9"\n[bus]\naddress = "127.0.0.1:{ports["bus"]}"\n'
        f"[dashboard]\nport = {ports['page']}\n",
        encoding="utf-8",
    )
    with socket.create_server(("127.0.0.1", ports[taken])):
        done = subprocess.run(
            [sys.executable, "-m", "thumper", "run", "--ui", "--config", config, "--out", tmp_path],
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr.startswith("thumper: ")
    assert done.stderr.count("\n") == 1
    assert f"127.0.0.1:{ports[taken]}" in done.stderr
    assert {"page": "--port of `thumper dashboard`", "bus": "Choose another address"}[taken] in done.stderr
