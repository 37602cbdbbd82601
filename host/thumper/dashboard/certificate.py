"""A certificate that the machine signs for itself: HTTPS in a class room without anybody's authority."""

import datetime
import ipaddress
import os
import socket
import ssl
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError

VALID_DAYS = 825  # browsers refuse longer ones
BACKDATED = datetime.timedelta(days=1)  # the clients' clocks may be behind


def make_certificate(certificate: Path, key: Path, names: list[str]) -> str:
    """Write key and certificate for `names` (host names, addresses); return its SHA-256 fingerprint.

    Raises
    ------
    ThumperError
        One of the files is there already, or cannot be written.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    for path in (certificate, key):  # before either is written: half a pair is of no use
        if path.exists():
            raise ThumperError(
                f"{path} is there already; move it away to make a new one", exit_code=EXIT_USAGE
            )
    secret = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"Thumper on {socket.gethostname()}"[:64])])
    now = datetime.datetime.now(datetime.UTC)
    signed = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(secret.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + datetime.timedelta(days=VALID_DAYS) - BACKDATED)
        .add_extension(x509.SubjectAlternativeName([_name(name) for name in names]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(secret, hashes.SHA256())
    )
    pem = secret.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    _write_new(key, pem, mode=0o600)
    _write_new(certificate, signed.public_bytes(serialization.Encoding.PEM), mode=0o644)
    return signed.fingerprint(hashes.SHA256()).hex(":").upper()


def server_tls(certificate: Path, key: Path) -> ssl.SSLContext:
    """What a server of ours shows to its clients; raises ThumperError when the files are none for that."""
    tls = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        tls.load_cert_chain(certificate, key)
    except OSError as error:  # also ssl's own
        raise ThumperError(
            f"{certificate}, {key}: they cannot be used ({error})", exit_code=EXIT_USAGE
        ) from error
    return tls


def own_names(host: str) -> list[str]:
    """What this machine may be called by: its host name, `host` if it is an address, loopback."""
    names = [socket.gethostname(), "localhost", "127.0.0.1"]
    if host not in ("0.0.0.0", "::", *names):
        names.append(host)
    return names


def _name(name: str):  # type: ignore[no-untyped-def]  # x509 is imported late
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _write_new(path: Path, content: bytes, *, mode: int) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(content)
    except OSError as error:
        raise ThumperError(f"cannot write {path}: {error.strerror}", exit_code=EXIT_USAGE) from error
