"""Self-signed certificates: HTTPS in a classroom without a certificate authority."""

import socket
import ssl
from pathlib import Path

from thumper.common.certificates import make_pair, refuse_existing
from thumper.common.errors import EXIT_USAGE, ThumperError


def make_certificate(certificate: Path, key: Path, names: list[str]) -> str:
    """Write key and certificate for `names` (host names, addresses); return the SHA-256 fingerprint.

    Raises
    ------
    ThumperError
        One of the files exists already, or cannot be written.
    """
    refuse_existing(certificate, key)
    pair = make_pair(f"Thumper on {socket.gethostname()}", names)
    pair.write(certificate, key)
    return pair.fingerprint


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
