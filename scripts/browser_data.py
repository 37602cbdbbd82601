"""Write the data that the robot in the browser shares with the firmware and the simulated robot, as JSON.

Run: .venv/bin/python scripts/browser_data.py hil/browser/build
"""

import json
import sys
import tomllib
from dataclasses import asdict
from pathlib import Path

from thumper.board.fault_texts import FAULT_HINTS, FAULT_NAMES
from thumper_hil.chip.robot_params import RobotParams

ROOT = Path(__file__).resolve().parents[1]


def tables(robot: RobotParams) -> dict[str, dict[str, float]]:
    """Return a robot's tables, with the moments that follow from its friction."""
    named = asdict(robot)
    named["body"] |= {"scrub_Nm": robot.body.scrub_Nm, "traction_Nm": robot.body.traction_Nm}
    return named


def main() -> None:
    """Write robot.json, protocol.json and faults.json into the folder."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    data = {
        "robot": tables(RobotParams.load()),
        "protocol": tomllib.loads((ROOT / "firmware/protocol/messages.toml").read_text(encoding="utf-8")),
        "faults": {
            fault.name: {"name": FAULT_NAMES[fault], "hint": hint} for fault, hint in FAULT_HINTS.items()
        },
    }
    for name, content in data.items():
        (folder / f"{name}.json").write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    main()
