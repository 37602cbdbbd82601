"""`thumper teleop`: drive a running robot by hand, from the keyboard or a gamepad."""

import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Annotated, Any

import typer

from thumper.cli.bus_options import Address, Config, Robot, join

if TYPE_CHECKING:
    from thumper.bus.heartbeat_sender import HeartbeatSender
    from thumper.teleop.gamepad import Gamepad
    from thumper.teleop.teleop_loop import TeleopLoop

LINE_PERIOD_S = 0.2
HELP = """r: arm, then hold a key to drive:   u i o    (or the arrow keys; with Shift: turbo)
                                    j k l    k stops
                                    m , .
Space, Esc: EMERGENCY STOP   c: clear the fault   f: disarm   q: leave
gamepad: hold LB to drive (RB: turbo), left stick forward, right stick turns, B: EMERGENCY STOP,
         Start: arm, Back: disarm"""


def teleop(
    gamepad: Annotated[bool, typer.Option(help="Look for a gamepad as well (needs pygame).")] = True,
    config: Config = None,
    bus: Address = "",
    robot: Robot = "",
) -> None:
    """Drive a running robot by hand; whatever it was driving to by itself is given up.

    The robot drives only while a key or the pad's button is held. Without either, or when this program, the
    pad or the network fails, it stands within half a second.
    """
    from thumper.bus.heartbeat_sender import HeartbeatSender
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.robot import load_config
    from thumper.teleop.keyboard import raw_terminal
    from thumper.teleop.teleop_loop import TeleopLoop

    settings = load_config(config)
    heard: dict[str, str] = {}
    with ExitStack() as stack:
        client = stack.enter_context(join(config, bus, robot))
        client.subscribe("status", lambda message: heard.update(status=_status_words(message)))
        client.subscribe("events", lambda message: heard.update(event=message.msg))
        pad = _gamepad(stack) if gamepad else None
        terminal = stack.enter_context(raw_terminal())
        if terminal is None and pad is None:
            raise ThumperError(
                "neither a terminal to type in nor a gamepad: start it in a terminal", exit_code=EXIT_USAGE
            )
        print(HELP)
        driver = TeleopLoop(settings, client.publish, terminal.read if terminal else bytes, pad)
        stack.callback(driver.release)
        try:
            _drive(driver, pad, heard, HeartbeatSender(client), 1.0 / settings.teleop.rate_Hz)
        except KeyboardInterrupt:
            pass
        finally:
            print()


def _drive(
    driver: "TeleopLoop",
    pad: "Gamepad | None",
    heard: dict[str, str],
    pulse: "HeartbeatSender",
    period_s: float,
) -> None:
    line_s, last_event = 0.0, ""
    due_s = time.monotonic()
    while driver.step(time.monotonic(), period_s):
        now_s = time.monotonic()
        if now_s >= line_s + LINE_PERIOD_S:
            line_s = now_s
            pulse.check()
            event = heard.get("event", "")
            if event != last_event:
                print(f"\r\033[K{event}")
                last_event = event
            hand = pad.name if pad and pad.name else "keyboard"
            twist = driver.twist
            said = heard.get("status", "")
            print(
                f"\r\033[K{hand}: {twist.v_m_s:+.2f} m/s {twist.w_rad_s:+.2f} rad/s | {said}",
                end="",
                flush=True,
            )
        due_s = max(due_s + period_s, now_s)  # a late beat is not made up for
        time.sleep(max(0.0, due_s - now_s))


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


def _status_words(message: Any) -> str:
    fault = f", {message.fault_words}: {message.fault_cure}" if message.fault else ""
    why = f" ({message.reason})" if message.reason else ""
    return f"{message.robot}: {message.mode}, {message.board_state}{why}{fault}"
