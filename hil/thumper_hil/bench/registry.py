"""The simulated robots of this process, by the NAME in `sim://NAME/board` and `sim://NAME/lidar`."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from thumper.common.errors import EXIT_NOT_THERE, EXIT_USAGE, ThumperError
from thumper_hil.bench.bench import Bench
from thumper_hil.bench.options import BenchOptions


@dataclass(slots=True)
class _Entry:
    bench: Bench
    options: Mapping[str, str]
    open_devices: set[str] = field(default_factory=set)


_entries: dict[str, _Entry] = {}


def simulation(name: str) -> Bench:
    """Return the bench of `sim://NAME/...`; its ground truth stays available after the ports are closed.

    Raises
    ------
    ThumperError
        No port with that name was opened in this process.
    """
    if name not in _entries:
        raise ThumperError(f"no simulation {name!r} in this process; open sim://{name}/board first")
    return _entries[name].bench


def open_device(name: str, device: str, options: Mapping[str, str]) -> Bench:
    """Open one device of a robot; the first open creates the robot with its options.

    After all its devices are closed, the next open creates a new robot.

    Raises
    ------
    ThumperError
        The device is already open, the options differ from those of the first open, or one is invalid.
    """
    entry = _entries.get(name)
    if entry is None or not entry.open_devices:
        entry = _Entry(bench=Bench(BenchOptions.parse(options)), options=dict(options))
        _entries[name] = entry
    elif device in entry.open_devices:
        raise ThumperError(
            f"the simulated {device} {name!r} is already open; close it first", exit_code=EXIT_NOT_THERE
        )
    elif options and options != entry.options:
        raise ThumperError(
            f"the simulation {name!r} runs with other options; give the options only with its first port",
            exit_code=EXIT_USAGE,
        )
    entry.bench.power_up(device)
    entry.open_devices.add(device)
    return entry.bench


def close_device(name: str, device: str) -> None:
    """Close one device of a robot."""
    _entries[name].open_devices.discard(device)


def forget_simulation(name: str) -> None:
    """Release the memory of a robot whose devices are closed: world and ground truth, 2 MB per drive."""
    _entries.pop(name, None)
