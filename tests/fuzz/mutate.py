"""Changes to a file's content that break readers: wrong bytes, values, lengths and nesting."""

import hashlib
import json
import random
import re

TOKENS = [
    *(b"", b"0", b"-1", b"1e999", b"-1e308", b"nan", b"inf", b"1e-400", b"9" * 30, b"9" * 5000, b"0.0000001"),
    *(
        b"\n",
        b"\r",
        b"\0",
        b"\x1b[2J",
        b"\xff\xfe",
        b"\xc3",
        "é\u202e".encode(),
        b" ",
        b"\t",
        b'"',
        b"'",
        b"#",
    ),
    *(
        b"[" * 5000,
        b"]",
        b"[[",
        b"{",
        b"}" * 3,
        b"a." * 3000,
        b"=",
        b",",
        b";",
        b":",
        b"true",
        b'"x"',
        b"[]",
        b"{}",
    ),
    *(b"1979-05-27T07:32:00Z", b"../../../../etc/passwd", b"/dev/zero", b"-", b"0x7fffffffffffffff", b"null"),
]
NUMBER = re.compile(rb"-?\d+(\.\d+)?")


def mutated(content: bytes, rng: random.Random) -> bytes:
    """Return the content after one to four random changes."""
    for _ in range(rng.randint(1, 4)):
        content = rng.choice((_bytes, _bytes, _token, _token, _number, _number, _cut, _copy, _drop))(
            content, rng
        )
    return content


def _bytes(content: bytes, rng: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(rng.randint(1, 8)):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _token(content: bytes, rng: random.Random) -> bytes:
    at = rng.randint(0, len(content))
    return content[:at] + rng.choice(TOKENS) + content[at + rng.choice((0, 0, 1, 4)) :]


def _number(content: bytes, rng: random.Random) -> bytes:
    """Replace a number by a token."""
    found = list(NUMBER.finditer(content[:100_000]))
    if not found:
        return content
    match = rng.choice(found)
    return content[: match.start()] + rng.choice(TOKENS) + content[match.end() :]


def _cut(content: bytes, rng: random.Random) -> bytes:
    return content[: rng.randint(0, len(content))]


def _copy(content: bytes, rng: random.Random) -> bytes:
    """Repeat a part elsewhere."""
    start, to = rng.randint(0, len(content)), rng.randint(0, len(content))
    return content[:to] + content[start : start + rng.randint(1, 200)] + content[to:]


def _drop(content: bytes, rng: random.Random) -> bytes:
    start = rng.randint(0, len(content))
    return content[:start] + content[start + rng.randint(1, 60) :]


def with_valid_checksum(session: bytes) -> bytes:
    """Return the session file with the checksum of its content, so that the rest is read, too."""
    first, newline, payload = session.partition(b"\n")
    try:
        header = json.loads(first)
        fields = {key: value for key, value in header.items() if key != "sha256"}
        digest = hashlib.sha256(json.dumps(fields, sort_keys=True).encode() + payload).hexdigest()
        return json.dumps(fields | {"sha256": digest}).encode() + newline + payload
    except (ValueError, AttributeError, RecursionError):
        return session
