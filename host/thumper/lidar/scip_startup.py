"""Wake a SCIP 2.0 lidar, whatever state it is in, and learn its geometry."""

from dataclasses import dataclass

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.lidar.clock import ClockSync
from thumper.lidar.scip import STATUS_OK, ScipError, parse_table, parse_time
from thumper.lidar.scip_port import ScipPort

REPLY_TIMEOUT_S = 0.3
PARAMETER_TRIES = 3
CLOCK_TRIES = 5
STATUS_ALREADY_ON = "02"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScipGeometry:
    """What PP tells: where the beams point, and when."""

    first_step: int  # AMIN
    last_step: int  # AMAX
    front_step: int  # AFRT: the step that looks ahead
    steps_per_revolution: int  # ARES
    revolution_s: float  # 60 / SCAN
    range_max_m: float  # DMAX

    def __post_init__(self) -> None:
        if not (
            0 <= self.first_step < self.last_step <= 9999
            and self.steps_per_revolution > 0
            and self.revolution_s > 0
        ):
            raise ValueError(f"no possible lidar: {self}")

    @property
    def beams(self) -> int:
        """Beams in one scan."""
        return self.last_step - self.first_step + 1

    @property
    def step_s(self) -> float:
        """Time from one beam to the next."""
        return self.revolution_s / self.steps_per_revolution


def stop_and_identify(port: ScipPort, name: str) -> dict[str, str]:
    """Stop a stream left running, switch to SCIP 2.0, and return the identity: VEND, PROD, FIRM, PROT, SERI.

    VV is asked once: some URG-04LX fall silent at the second. An empty identity is no error.

    Raises
    ------
    ThumperError
        Nothing, or nothing that speaks SCIP, is on the port called `name`.
    """
    answer = port.ask(b"QT", REPLY_TIMEOUT_S)
    port.ask(b"TM2", REPLY_TIMEOUT_S)  # somebody may have left it in clock mode, in which it obeys only TM
    port.ask(b"SCIP2.0", REPLY_TIMEOUT_S)  # needed by old units, unknown to new ones: any answer will do
    if answer is None and port.ask(b"QT", REPLY_TIMEOUT_S) is None:
        if port.received_bytes == 0:
            raise ThumperError(
                f"no lidar answers on {name}; is it plugged in? `thumper doctor` lists the ports",
                exit_code=EXIT_NOT_THERE,
            )
        raise ThumperError(
            f"what is on {name} is no SCIP 2.0 lidar; give the lidar's port, `thumper doctor` lists them",
            exit_code=EXIT_NOT_THERE,
        )
    identity = port.ask(b"VV", REPLY_TIMEOUT_S)
    return parse_table(identity)[0] if identity else {}


def read_geometry(port: ScipPort, name: str) -> ScipGeometry:
    """Ask for the parameters until they come without an error.

    Raises
    ------
    ThumperError
        They do not come, or make no sense.
    """
    for _ in range(PARAMETER_TRIES):
        reply = port.ask(b"PP", REPLY_TIMEOUT_S)
        if reply is None:
            continue
        table, bad_lines = parse_table(reply)
        if bad_lines:
            continue
        try:
            return ScipGeometry(
                first_step=int(table["AMIN"]),
                last_step=int(table["AMAX"]),
                front_step=int(table["AFRT"]),
                steps_per_revolution=int(table["ARES"]),
                revolution_s=60.0 / int(table["SCAN"]),
                range_max_m=1e-3 * int(table["DMAX"]),
            )
        except (KeyError, ValueError, ZeroDivisionError):
            continue
    raise ThumperError(
        f"the lidar on {name} does not tell its parameters (PP); unplug it, wait 5 s and plug it in again",
        exit_code=EXIT_NOT_THERE,
    )


def sync_clock(port: ScipPort, fit: ClockSync) -> None:
    """Ask for the device's clock a few times and give `fit` the quickest answer, if there is any."""
    best: tuple[float, int, float, float] | None = None
    if port.ask(b"TM0", REPLY_TIMEOUT_S) is None:
        return
    for _ in range(CLOCK_TRIES):
        asked_s = port.now_s()
        reply = port.ask(b"TM1", REPLY_TIMEOUT_S)
        answered_s = port.now_s()
        if reply is None or reply.status != STATUS_OK:
            continue
        try:
            attempt = (answered_s - asked_s, parse_time(reply), asked_s, answered_s)
        except ScipError:
            continue
        best = attempt if best is None else min(best, attempt)
    port.ask(b"TM2", REPLY_TIMEOUT_S)
    if best is not None:
        fit.sync(best[1], best[2], best[3])


def enable_laser(port: ScipPort, name: str) -> None:
    """Switch the laser on.

    Raises
    ------
    ThumperError
        The lidar refuses.
    """
    reply = port.ask(b"BM", REPLY_TIMEOUT_S)
    status = reply.status if reply else "none"
    if status not in {STATUS_OK, STATUS_ALREADY_ON}:
        raise ThumperError(
            f"the lidar on {name} does not light its laser (status {status}); "
            "unplug it, wait 5 s and plug it in again; if that does not help, it is broken",
            exit_code=EXIT_NOT_THERE,
        )
