"""Self-signed certificates: HTTPS in a classroom without a certificate authority."""

import datetime
import ipaddress
import os
import socket
import ssl
from pathlib import Path

from thumper.common.errors import EXIT_USAGE, ThumperError

VALID_DAYS = 825  # browsers refuse longer validity
BACKDATED = datetime.timedelta(days=1)  # clocks of clients may be slow


def make_certificate(certificate: Path, key: Path, names: list[str]) -> str:
    """Write key and certificate for `names` (host names, addresses); return the SHA-256 fingerprint.

    Raises
    ------
    ThumperError
        One of the files exists already, or cannot be written.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    for path in (certificate, key):  # before writing either: half a pair is useless
        if path.exists():
            raise ThumperError(f"{path} exists already; move it away to make a new one", exit_code=EXIT_USAGE)
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
    """Return a TLS context with this certificate; raises ThumperError if the files cannot be used."""
    tls = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    try:
        tls.load_cert_chain(certificate, key)
    except OSError as error:  # ssl.SSLError is one, too
        raise ThumperError(
            f"{certificate}, {key}: not a usable certificate and key ({error})", exit_code=EXIT_USAGE
        ) from error
    return tls


def local_names(host: str) -> list[str]:
    """Return the names of this computer: host name, `host` if it is an address, and loopback."""
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
