"""Whether the certificates in a Zenoh configuration are valid today, for who was not let in."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from keyexpr_schema.transport.zenoh_file import ZenohFile, said_in

_NAMED = ("connect_certificate", "root_ca_certificate")


def out_of_date(file: ZenohFile | None, now: datetime | None = None) -> str | None:
    """Which of its certificates is not valid at `now` (else by this host's clock), in a sentence;
    `None`: all are, there are none, or they cannot be read."""
    if file is None:
        return None
    for name in _NAMED:
        path = said_in(file.config(), f"transport/link/tls/{name}")
        if isinstance(path, str) and (wrong := _wrong(Path(path), now or datetime.now(UTC))):
            return wrong
    return None


def _wrong(path: Path, now: datetime) -> str | None:
    # Some tens of milliseconds to import, for those who have certificates.
    from cryptography import x509

    try:
        found = x509.load_pem_x509_certificates(path.read_bytes())
    except (OSError, ValueError):
        return None
    for each in found:
        if now > each.not_valid_after_utc:
            return (
                f"{path} has expired on {each.not_valid_after_utc:%Y-%m-%d}; make another with "
                "`robotctl certs` where the authority is"
            )
        if now < each.not_valid_before_utc:
            return (
                f"{path} is valid from {each.not_valid_before_utc:%Y-%m-%d %H:%M} UTC on, and by "
                f"the clock of this host it is {now:%Y-%m-%d %H:%M}: is that right?"
            )
    return None
