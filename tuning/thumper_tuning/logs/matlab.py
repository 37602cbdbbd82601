"""Read MATLAB files (.mat, up to version 7): vectors of one length, also in structs, or one matrix."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_bytes, unreadable
from thumper.common.geometry import FloatArray
from thumper_tuning.logs.table import MAX_MB, LogTable

MIN_ROWS = 3
MAX_UNPACKED_MB = 400
HEADER_BYTES, COMPRESSED = 128, 15


def read_matlab(path: Path) -> LogTable:
    """Return the vectors of the most common length; their names are the headers.

    Without vectors, return the columns of the longest matrix, with the headers 1, 2, ...

    Raises
    ------
    ThumperError
        The file cannot be read, is of version 7.3 (HDF5), or holds no vectors.
    """
    from scipy.io import loadmat

    try:
        packed = read_bytes(path, MAX_MB)
        if not _is_small(packed):
            raise ThumperError(
                f"{path}: unpacks to more than {MAX_UNPACKED_MB} MB; pass a log", exit_code=EXIT_USAGE
            )
        content = loadmat(BytesIO(packed), squeeze_me=True, struct_as_record=False)
    except ThumperError:
        raise
    except OSError as error:
        raise unreadable(path, error) from error
    except NotImplementedError as error:
        raise ThumperError(
            f"{path}: a MATLAB 7.3 file; save it with `save('log.mat', '-v7')`", exit_code=EXIT_USAGE
        ) from error
    except Exception as error:  # the parser raises many kinds for damaged files
        raise ThumperError(f"{path}: not a MATLAB file ({error})", exit_code=EXIT_USAGE) from error
    vectors = dict(_vectors(content))
    lengths = [len(values) for values in vectors.values() if len(values) >= MIN_ROWS]
    matrix = max(_matrices(content), key=len, default=None)
    if not lengths and matrix is not None:
        return LogTable(headers=tuple(str(k + 1) for k in range(matrix.shape[1])), values=matrix)
    if not lengths:
        raise ThumperError(
            f"{path}: no vectors of numbers in it (of a timeseries or table object, save vectors)",
            exit_code=EXIT_USAGE,
        )
    length = max(set(lengths), key=lambda one: (lengths.count(one), one))
    chosen = {name: values for name, values in vectors.items() if len(values) == length}
    return LogTable(headers=tuple(chosen), values=np.column_stack(list(chosen.values())))


def _is_small(content: bytes) -> bool:
    """Return whether the compressed variables unpack to less than the limit (MAT-File Format, version 5)."""
    order = "<" if content[126:128] == b"IM" else ">"
    at, left = HEADER_BYTES, int(1e6 * MAX_UNPACKED_MB)
    while len(content) >= at + 8:
        kind, length = struct.unpack_from(f"{order}II", content, at)
        if kind == COMPRESSED:
            left -= len(zlib.decompressobj().decompress(content[at + 8 : at + 8 + length], left))
        if left <= 0:
            return False
        at += 8 + length
    return True


def _vectors(content: dict[str, Any]) -> Iterator[tuple[str, FloatArray]]:
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if hasattr(value, "_fieldnames"):
            yield from _vectors(_named_by_signal(name, {f: getattr(value, f) for f in value._fieldnames}))
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub":
            yield name, value.astype(float)


def _named_by_signal(name: str, fields: dict[str, Any]) -> dict[str, Any]:
    """Name the vectors of signals: Time and Data in a struct, or Simulink's "structure with time"."""
    by_name = {field.lower(): value for field, value in fields.items()}
    if "time" in by_name and "data" in by_name:
        return {"time": by_name["time"], name: by_name["data"]}
    if "time" in by_name and "signals" in by_name:
        signals = np.atleast_1d(by_name["signals"])
        return {"time": by_name["time"], **{str(s.label) or name: s.values for s in signals}}
    return fields


def _matrices(content: dict[str, Any]) -> Iterator[FloatArray]:
    """Yield the matrices with a row for each sample; a sample in each column is transposed."""
    for value in content.values():
        if isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiub":
            rows = value if value.shape[0] >= value.shape[1] else value.T
            if len(rows) >= MIN_ROWS:
                yield rows.astype(float)
