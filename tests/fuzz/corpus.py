"""Inputs that once broke a reader: one folder per reader, tried again by each test run."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

CORPUS = Path(__file__).parent / "corpus"


def kept(reader: str) -> list[bytes]:
    """Return the kept inputs of a reader."""
    return [path.read_bytes() for path in sorted((CORPUS / reader).glob("*"))]


@contextmanager
def kept_if_it_fails(reader: str, content: bytes) -> Iterator[None]:
    """Keep the input if the test fails with it."""
    try:
        yield
    except BaseException:
        path = CORPUS / reader / hashlib.sha256(content).hexdigest()[:12]
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        raise
