"""Keys and certificates (X.509, EC P-256) for the page and the bus. Needs the package `cryptography`."""

import datetime
import ipaddress
import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from thumper.common.errors import EXIT_USAGE, ThumperError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate, GeneralName

VALID_DAYS = 825  # browsers refuse longer validity
BACKDATED = datetime.timedelta(days=1)  # clocks of clients may be slow


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyPair:
    """A certificate and its private key."""

    certificate: "Certificate"
    key: "EllipticCurvePrivateKey"

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the certificate, as browsers show it."""
        from cryptography.hazmat.primitives import hashes

        return self.certificate.fingerprint(hashes.SHA256()).hex(":").upper()

    def write(self, certificate: Path, key: Path) -> None:
        """Write both as PEM, the key readable by its owner alone.

        Raises
        ------
        ThumperError
            One of the files exists already, or cannot be written.
        """
        from cryptography.hazmat.primitives import serialization

        refuse_existing(certificate, key)
        pem = self.key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
        write_new(key, pem, mode=0o600)
        write_new(certificate, self.certificate.public_bytes(serialization.Encoding.PEM), mode=0o644)


def make_pair(
    title: str,
    names: list[str],
    *,
    issuer: KeyPair | None = None,
    use: Literal["server", "client", "authority"] = "server",
) -> KeyPair:
    """Return a new certificate for `names` (host names, addresses), signed by `issuer` or by itself."""
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, title[:64])])
    now = datetime.datetime.now(datetime.UTC)
    is_authority = use == "authority"
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer.certificate.subject if issuer else subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + datetime.timedelta(days=VALID_DAYS) - BACKDATED)
        .add_extension(x509.BasicConstraints(ca=is_authority, path_length=None), critical=True)
    )
    if names:
        builder = builder.add_extension(
            x509.SubjectAlternativeName([_name(name) for name in names]), critical=False
        )
    if not is_authority:
        purpose = ExtendedKeyUsageOID.SERVER_AUTH if use == "server" else ExtendedKeyUsageOID.CLIENT_AUTH
        builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
    return KeyPair(certificate=builder.sign(issuer.key if issuer else key, hashes.SHA256()), key=key)


def local_names(host: str) -> list[str]:
    """Return the names of this computer: host name, `host` if it is an address, and loopback."""
    names = [socket.gethostname(), "localhost", "127.0.0.1"]
    if host not in ("0.0.0.0", "::", *names):
        names.append(host)
    return names


def refuse_existing(*paths: Path) -> None:
    """Raise ThumperError if one of the files exists: half a pair is useless."""
    for path in paths:
        if path.exists():
            raise ThumperError(f"{path} exists already; move it away to make a new one", exit_code=EXIT_USAGE)


def write_new(path: Path, content: bytes, *, mode: int) -> None:
    """Write a new file and its folder; raises ThumperError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
            file.write(content)
    except OSError as error:
        raise ThumperError(f"cannot write {path}: {error.strerror}", exit_code=EXIT_USAGE) from error


def _name(name: str) -> "GeneralName":
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)
