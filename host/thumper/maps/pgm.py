"""8-bit portable grey maps, binary (P5) and text (P2). Format: https://netpbm.sourceforge.net/doc/pgm.html."""

import numpy as np
from numpy.typing import NDArray


def encode_pgm(image: NDArray[np.uint8]) -> bytes:
    """Return the P5 file of an image, shape (rows, columns), first row on top."""
    rows, cols = image.shape
    return f"P5\n{cols} {rows}\n255\n".encode() + np.ascontiguousarray(image).tobytes()


def decode_pgm(data: bytes) -> NDArray[np.uint8]:
    """Return the image, shape (rows, columns), scaled to 0...255 if the file's maximum is smaller.

    Raises
    ------
    ValueError
        Not an 8-bit PGM, or the pixels do not fill it; the message says which.
    """
    magic, position = _token(data, 0)
    if magic not in (b"P5", b"P2"):
        raise ValueError(f"is not a PGM image (it starts with {data[:2]!r})")
    header: list[int] = []
    for name in ("width", "height", "maximum"):
        word, position = _token(data, position)
        if not word.isdigit() or int(word) == 0:
            raise ValueError(f"has the {name} {word.decode('ascii', 'replace')!r}")
        header.append(int(word))
    cols, rows, maximum = header
    if maximum > 255:
        raise ValueError(f"has the maximum {maximum}, not 8 bits")
    if magic == b"P5":
        pixels = np.frombuffer(data[position + 1 :], dtype=np.uint8)
    else:
        words = data[position:].split()
        if not all(word.isdigit() and int(word) <= maximum for word in words):
            raise ValueError(f"has a pixel that is not a number up to {maximum}")
        pixels = np.array([int(word) for word in words], dtype=np.uint8)
    if pixels.size < rows * cols:
        raise ValueError(f"is cut off: {pixels.size} pixels of {rows * cols}")
    image = pixels[: rows * cols].reshape(rows, cols)
    if maximum == 255:
        return image.copy()
    return (image.astype(np.uint16) * 255 // maximum).astype(np.uint8)


def _token(data: bytes, position: int) -> tuple[bytes, int]:
    """The next word of the header and the place after it; comments run from # to the end of the line."""
    while position < len(data):
        if data[position : position + 1] == b"#":
            end = data.find(b"\n", position)
            position = len(data) if end < 0 else end
        elif data[position : position + 1].isspace():
            position += 1
        else:
            break
    start = position
    while position < len(data) and not data[position : position + 1].isspace():
        position += 1
    return data[start:position], position
