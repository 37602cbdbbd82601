"""The C API of libthumper_chip.so (chip/native/c_api.cpp), declared for ctypes."""

import ctypes
from functools import cache
from pathlib import Path

LIBRARY = Path(__file__).parent / "native" / "build" / "libthumper_chip.so"


class CTruth(ctypes.Structure):
    """`ThumperTruth` of c_api.cpp."""

    _fields_ = (
        ("time_s", ctypes.c_double),
        ("x_m", ctypes.c_double),
        ("y_m", ctypes.c_double),
        ("yaw_rad", ctypes.c_double),
        ("wheel_rad", ctypes.c_double * 2),
        ("wheel_rad_s", ctypes.c_double * 2),
        ("current_A", ctypes.c_double * 2),
        ("encoder_count", ctypes.c_double * 2),
        ("battery_V", ctypes.c_double),
        ("charge", ctypes.c_double),
    )


class CVectorCost(ctypes.Structure):
    """`VectorCost` of probe.hpp."""

    _fields_ = tuple((name, ctypes.c_uint64) for name in ("entries", "cycles", "least", "most"))

    entries: int
    cycles: int
    least: int
    most: int


class CProbeReport(ctypes.Structure):
    """`ProbeReport` of probe.hpp."""

    _fields_ = (
        ("vector", CVectorCost * 26),
        *(
            (name, ctypes.c_uint64)
            for name in (
                "interrupts_off",
                "interrupts_off_address",
                "deepest_stack",
                "tick_least",
                "tick_most",
                "awake",
                "main_awake",
                "marks",
                "marked",
                "marked_most",
            )
        ),
    )

    vector: ctypes.Array[CVectorCost]
    interrupts_off: int
    interrupts_off_address: int
    deepest_stack: int
    tick_least: int
    tick_most: int
    awake: int
    main_awake: int
    marks: int
    marked: int
    marked_most: int


@cache
def load_library() -> ctypes.CDLL:
    """Load the library once and declare its functions.

    Raises OSError if it is not built, AttributeError if it was built from older sources.
    """
    library = ctypes.CDLL(str(LIBRARY))
    chip, number = ctypes.c_void_p, ctypes.c_double
    size, cycle, byte = ctypes.c_size_t, ctypes.c_uint64, ctypes.c_uint8
    signatures: dict[str, tuple[object, list[object]]] = {
        "open": (
            chip,
            [ctypes.c_char_p, ctypes.POINTER(number), size, ctypes.c_int, cycle, ctypes.c_char_p, size],
        ),
        "close": (None, [chip]),
        "run": (ctypes.c_int, [chip, cycle, size]),
        "cycle": (cycle, [chip]),
        "resets": (cycle, [chip]),
        "slept_cycles": (cycle, [chip]),
        "overruns": (cycle, [chip]),
        "data": (byte, [chip, ctypes.c_uint16]),
        "reset": (None, [chip]),
        "program_counter": (ctypes.c_uint32, [chip]),
        "set_host_baud": (None, [chip, ctypes.c_uint32]),
        "send": (None, [chip, ctypes.c_char_p, size]),
        "available": (size, [chip]),
        "receive": (size, [chip, ctypes.c_char_p, ctypes.POINTER(cycle), size]),
        "truth": (None, [chip, ctypes.POINTER(CTruth)]),
        "place": (None, [chip, number, number, number]),
        "hold": (None, [chip, number, number]),
        "release": (None, [chip]),
        "set_attitude": (None, [chip, number, number]),
        "set_climb": (None, [chip, number]),
        "side_faults": (
            None,
            [chip, ctypes.c_int, number, number, ctypes.c_int, ctypes.c_int, ctypes.c_int, number],
        ),
        "swap_channels": (None, [chip, ctypes.c_int, ctypes.c_int]),
        "glitches": (None, [chip, ctypes.c_int, number]),
        "wire_fault": (None, [chip, ctypes.c_int, ctypes.c_int, ctypes.c_int]),
        "set_switch": (None, [chip, ctypes.c_int, ctypes.c_int]),
        "set_battery": (None, [chip, number, number]),
        "stop_adc": (None, [chip, ctypes.c_int]),
        "fit_gyroscope": (None, [chip, number, ctypes.c_int, ctypes.c_int]),
        "power_gyroscope": (None, [chip, ctypes.c_int]),
        "freeze_gyroscope": (None, [chip, ctypes.c_int]),
        "hold_twi_data": (None, [chip, ctypes.c_int]),
        "hold_twi_clock": (None, [chip, ctypes.c_int]),
        "move_currents": (None, [chip, ctypes.c_int]),
        "line_noise": (None, [chip, number, number]),
        "hang": (None, [chip, ctypes.c_int]),
        "write_flash": (ctypes.c_int, [chip, ctypes.c_uint32, ctypes.c_char_p, size]),
        "read_flash": (ctypes.c_int, [chip, ctypes.c_uint32, ctypes.c_char_p, size]),
        "write_eeprom": (ctypes.c_int, [chip, ctypes.c_uint32, ctypes.c_char_p, size]),
        "read_eeprom": (ctypes.c_int, [chip, ctypes.c_uint32, ctypes.c_char_p, size]),
        "start_at": (None, [chip, ctypes.c_uint32]),
        "poke": (None, [chip, ctypes.c_uint16, byte]),
        "edges_open": (ctypes.c_void_p, [chip, ctypes.c_char, ctypes.c_int, ctypes.c_int]),
        "edges_start": (None, [ctypes.c_void_p, cycle, cycle, cycle]),
        "edges_close": (None, [ctypes.c_void_p]),
        "sweep": (
            ctypes.c_int,
            [
                *(chip, ctypes.c_void_p, cycle, ctypes.c_int, ctypes.c_char, ctypes.c_int),
                *(ctypes.c_char_p, size, cycle, ctypes.c_int, ctypes.c_int, ctypes.c_char_p),
                *(ctypes.c_void_p, size),
            ],
        ),
        "probe_open": (ctypes.c_void_p, [chip, ctypes.c_int]),
        "probe_run": (ctypes.c_int, [ctypes.c_void_p, cycle]),
        "probe_report": (None, [ctypes.c_void_p, ctypes.c_void_p]),
        "probe_bursts": (size, [ctypes.c_void_p, ctypes.POINTER(cycle), size]),
        "probe_close": (None, [ctypes.c_void_p]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"thumper_{name}")
        function.restype, function.argtypes = result, arguments
    return library
