"""Start a SCIP 2.0 lidar from any state and read its geometry."""

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
    """Beam directions and timing, from the reply to PP."""

    first_step: int  # AMIN
    last_step: int  # AMAX
    front_step: int  # AFRT: the step that points straight ahead
    steps_per_revolution: int  # ARES
    revolution_s: float  # 60 / SCAN
    range_max_m: float  # DMAX

    def __post_init__(self) -> None:
        if not (
            0 <= self.first_step < self.last_step <= 9999
            and self.steps_per_revolution > 0
            and self.revolution_s > 0
        ):
            raise ValueError(f"impossible geometry: {self}")

    @property
    def beams(self) -> int:
        """Number of beams in one scan."""
        return self.last_step - self.first_step + 1

    @property
    def step_s(self) -> float:
        """Time from one beam to the next."""
        return self.revolution_s / self.steps_per_revolution


def stop_and_identify(port: ScipPort) -> dict[str, str]:
    """Stop a running stream, switch to SCIP 2.0 and return the identity: VEND, PROD, FIRM, PROT, SERI.

    Sends VV only once, because some URG-04LX stop answering after a second one. An empty identity is valid.

    Raises
    ------
    ThumperError
        No device answers, or the device does not speak SCIP.
    """
    answer = port.request(b"QT", REPLY_TIMEOUT_S)
    port.request(b"TM2", REPLY_TIMEOUT_S)  # leave clock mode, in which the lidar accepts only TM
    port.request(b"SCIP2.0", REPLY_TIMEOUT_S)  # old units need it, new ones do not know it: ignore the reply
    if answer is None and port.request(b"QT", REPLY_TIMEOUT_S) is None:
        if port.received_bytes == 0:
            raise ThumperError(
                f"no lidar answers on {port.url}; is it plugged in? `thumper doctor` lists the ports",
                exit_code=EXIT_NOT_THERE,
            )
        raise ThumperError(
            f"the device on {port.url} is not a SCIP 2.0 lidar; set the lidar's port "
            "(`thumper doctor` lists the ports)",
            exit_code=EXIT_NOT_THERE,
        )
    identity = port.request(b"VV", REPLY_TIMEOUT_S)
    return parse_table(identity)[0] if identity else {}


def read_geometry(port: ScipPort) -> ScipGeometry:
    """Request the parameters until they arrive without an error.

    Raises
    ------
    ThumperError
        They do not arrive, or are impossible.
    """
    for _ in range(PARAMETER_TRIES):
        reply = port.request(b"PP", REPLY_TIMEOUT_S)
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
        f"the lidar on {port.url} does not report its parameters (PP); "
        "unplug it, wait 5 s and plug it in again",
        exit_code=EXIT_NOT_THERE,
    )


def sync_clock(port: ScipPort, clock_sync: ClockSync) -> None:
    """Read the device's clock a few times and pass the fastest reply, if any, to `clock_sync`."""
    best: tuple[float, int, float, float] | None = None
    if port.request(b"TM0", REPLY_TIMEOUT_S) is None:
        return
    for _ in range(CLOCK_TRIES):
        sent_s = port.now_s()
        reply = port.request(b"TM1", REPLY_TIMEOUT_S)
        received_s = port.now_s()
        if reply is None or reply.status != STATUS_OK:
            continue
        try:
            attempt = (received_s - sent_s, parse_time(reply), sent_s, received_s)
        except ScipError:
            continue
        best = attempt if best is None else min(best, attempt)
    port.request(b"TM2", REPLY_TIMEOUT_S)
    if best is not None:
        clock_sync.sync(best[1], best[2], best[3])


def enable_laser(port: ScipPort) -> None:
    """Switch the laser on.

    Raises
    ------
    ThumperError
        The lidar refuses.
    """
    reply = port.request(b"BM", REPLY_TIMEOUT_S)
    status = reply.status if reply else "none"
    if status not in {STATUS_OK, STATUS_ALREADY_ON}:
        raise ThumperError(
            f"the lidar on {port.url} does not switch its laser on (status {status}); "
            "unplug it, wait 5 s and plug it in again. If that does not help, the lidar is broken",
            exit_code=EXIT_NOT_THERE,
        )
