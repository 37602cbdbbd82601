"""`thumper teleop`: drive a running robot manually with keyboard or gamepad."""

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thumper.cli.options.bus import connect
from thumper.cli.options.common import BusAddress, ConfigFile, RobotName
from thumper.cli.output.status_line import one_row

if TYPE_CHECKING:
    from thumper.bus.status_watchdog import StatusWatchdog
    from thumper.common.geometry import Twist2
    from thumper.ros.codec import Message
    from thumper.teleop.gamepad import Gamepad
    from thumper.teleop.teleop_loop import TeleopLoop

CONNECTING = "connecting to the robot ..."
LINE_PERIOD_S = 0.2
DISARM_TIMEOUT_S = 2.0
HELP = """r: arm, then hold a key to drive:   u i o   (or W A S D, or the arrow keys)
                                    j k l   k stops; Shift: turbo
                                    m , .
Space, Esc: EMERGENCY STOP   c: clear the fault   f: disarm   q: quit
gamepad: hold LB to drive (RB: turbo), left stick forward, right stick turns,
         B: EMERGENCY STOP, Start: arm, Back: disarm, hold X: ignore obstacles"""

NO_TERMINAL = "no terminal, so no keys: drive with a gamepad, plugged in now or later"


def teleop(
    gamepad: Annotated[bool, typer.Option(help="Also use a gamepad, if there is one (needs pygame).")] = True,
    assist: Annotated[
        bool, typer.Option("--assist/--no-assist", help="Slow down and stop before obstacles.")
    ] = True,
    config: ConfigFile = None,
    bus: BusAddress = "",
    robot: RobotName = "",
) -> None:
    """Drive a running robot manually with keyboard or gamepad; this cancels its current goal.

    Drive with W A S D, the arrow keys, or the keys around k. The robot drives only while you hold a key or
    the gamepad's button; the first press of a key counts for 0.6 s. If this program, the gamepad or the
    network fails, the last command ends within 0.6 s, and the robot stops. At its end, this program disarms
    the robot if it has armed it.

    Examples:

    - `thumper teleop`
    - `thumper teleop --bus 192.168.1.20:7448 --no-gamepad`
    """
    from thumper.teleop.terminal import raw_terminal

    latest: dict[str, str] = {}
    with ExitStack() as stack:
        terminal = stack.enter_context(raw_terminal())  # before the slow imports: no key appears as text
        print(f"{one_row('')}{CONNECTING}" if terminal else CONNECTING, flush=True)
        from thumper.bus.status_watchdog import StatusWatchdog
        from thumper.common.errors import EXIT_USAGE, ThumperError
        from thumper.config.robot import load_config
        from thumper.teleop.teleop_loop import TeleopLoop

        settings = load_config(config)
        client = stack.enter_context(connect(config, bus, robot))
        client.subscribe("status", lambda message: latest.update(_newest(message)))
        client.subscribe("events", lambda message: latest.update(event=message.msg))
        pad = _gamepad(stack) if gamepad else None
        if terminal is None and pad is None:
            raise ThumperError(
                "neither a terminal nor a gamepad to drive with; start it in a terminal", exit_code=EXIT_USAGE
            )
        if terminal:
            terminal.drop()  # who pressed a key before the help appeared did not know what it does
        print(HELP if terminal else NO_TERMINAL, flush=True)
        loop = TeleopLoop(
            settings, client.publish, terminal.read if terminal else bytes, pad, assisted=assist
        )
        stack.callback(loop.release)
        try:
            watchdog = StatusWatchdog(client, lambda line: latest.update(state=line, detail=""))
            period_s = 1.0 / settings.teleop.rate_Hz
            _drive(loop, pad, latest, watchdog, period_s, status_line=terminal is not None)
        except KeyboardInterrupt:
            pass
        finally:
            print()
        _leave(loop, client.publish, latest)


def _drive(
    loop: "TeleopLoop",
    pad: "Gamepad | None",
    latest: dict[str, str],
    heartbeat: "StatusWatchdog",
    period_s: float,
    *,
    status_line: bool,
) -> None:
    """Run the loop until the operator quits; print events and, if wanted, a status line every 0.2 s."""
    line_s, last_event = 0.0, ""
    due_s = time.monotonic()
    while loop.step(time.monotonic(), period_s):
        now_s = time.monotonic()
        if now_s >= line_s + LINE_PERIOD_S:
            line_s = now_s
            heartbeat.check()
            event = latest.get("event", "")
            if event != last_event:
                print(f"{one_row('')}{event}" if status_line else event, flush=True)
                last_event = event
            if status_line:
                print(one_row(_status(loop.twist, latest, pad)), end="", flush=True)
        due_s = max(due_s + period_s, now_s)  # do not catch up on missed cycles
        time.sleep(max(0.0, due_s - now_s))


def _leave(loop: "TeleopLoop", publish: "Callable[[str, Message], None]", latest: Mapping[str, str]) -> None:
    """Disarm what this program has armed, unless another one drives by now; say if it stays armed."""
    from thumper.board.fault_texts import ARMED_STATES
    from thumper.ros.to_ros import text

    if loop.has_armed and latest.get("mode") != "driving":
        publish("command", text("disarm"))
        end_s = time.monotonic() + DISARM_TIMEOUT_S
        while latest.get("board") in ARMED_STATES and time.monotonic() < end_s:
            time.sleep(LINE_PERIOD_S / 4)
        if latest.get("board") not in ARMED_STATES:
            print("disarmed, because this program armed it")
            return
    if latest.get("board") in ARMED_STATES:
        print("the robot is still armed; `thumper stop` switches the motors off")


def _gamepad(stack: ExitStack) -> "Gamepad | None":
    from thumper.common.errors import ThumperError
    from thumper.teleop.gamepad import Gamepad

    try:
        pad = Gamepad()
    except ThumperError as error:
        print(f"no gamepad: {error}")
        return None
    stack.callback(pad.close)
    return pad


def _status(twist: "Twist2", latest: Mapping[str, str], pad: "Gamepad | None") -> str:
    """Return the status line, the most important first: a terminal may cut it."""
    speeds = f"{twist.v_m_s:+.2f} m/s {twist.w_rad_s:+.2f} rad/s"
    device = pad.name if pad and pad.name else "keyboard"
    return " | ".join(filter(None, (latest.get("state", ""), speeds, latest.get("detail", ""), device)))


def _newest(message: Any) -> dict[str, str]:
    """Return the state of the robot in plain words, and what else the operator must know."""
    from thumper.board.fault_texts import STATE_NAMES

    state, detail = STATE_NAMES.get(message.board_state, ""), message.reason
    if message.fault:
        state, detail = f"FAULT, {message.fault_words}", "c: clear it"  # an event line shows the fix
    elif detail.startswith("driven by"):  # a program, or this one, which may be slowed before an obstacle
        detail = detail.partition("; ")[2]
    if detail == state:  # armed
        detail = ""
    return {"state": state, "detail": detail, "board": message.board_state, "mode": message.mode}
