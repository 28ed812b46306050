"""The list of certificates that an authority has taken back (X.509 CRL; RFC 5280, 5)."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding

from cli.errors import BadCertificates
from keyexpr_schema.private_files import write_private
from keyexpr_schema.transport.revocations import lists_in

NEXT = timedelta(days=3650)
"""The format wants to know when the next list comes at the latest; one holds until there is one."""


def read_lists(path: Path) -> list[x509.CertificateRevocationList]:
    """Those in a file.

    Raises:
        BadCertificates: there is none, or something else.
    """
    try:
        return lists_in(path.read_bytes())
    except FileNotFoundError:
        raise BadCertificates(
            f"there is no list of revoked certificates in {path}: `robotctl certs revoke` makes it"
        ) from None
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise BadCertificates(
            f"the list of revoked certificates in {path} cannot be read: {why}"
        ) from None


def write_list(
    path: Path,
    issuer: x509.Name,
    key: ec.EllipticCurvePrivateKey,
    revoked: Iterable[tuple[int, float]],
    now: datetime,
) -> None:
    """Write a list with these serial numbers, and since when they are revoked [s, Unix], over the
    one before; those of other authorities in the file stay there.

    Raises:
        BadCertificates: the one before cannot be read.
        OSError: the folder cannot be written.
    """
    public = key.public_key()
    ours: list[x509.CertificateRevocationList] = []
    others: list[x509.CertificateRevocationList] = []
    for each in _before(path):
        by_us = each.issuer == issuer and each.is_signature_valid(public)
        (ours if by_us else others).append(each)
    last = max(map(_number, ours), default=0)
    builder = (
        x509.CertificateRevocationListBuilder()
        .issuer_name(issuer)
        .last_update(now)
        .next_update(now + NEXT)
        .add_extension(x509.CRLNumber(max(int(now.timestamp() * 1000), last + 1)), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(public), critical=False)
    )
    for serial, since_s in revoked:
        builder = builder.add_revoked_certificate(
            x509.RevokedCertificateBuilder()
            .serial_number(serial)
            .revocation_date(datetime.fromtimestamp(since_s, UTC))
            .build()
        )
    lists = (builder.sign(key, hashes.SHA256()), *others)
    write_private(path, b"".join(each.public_bytes(Encoding.PEM) for each in lists))


def _before(path: Path) -> list[x509.CertificateRevocationList]:
    """Those that are written over."""
    try:
        return read_lists(path) if path.exists() else []
    except BadCertificates as error:
        raise BadCertificates(
            f"{error}; move it away, and it is made anew with all that this authority has revoked"
        ) from None


def _number(list_: x509.CertificateRevocationList) -> int:
    try:
        return list_.extensions.get_extension_for_class(x509.CRLNumber).value.crl_number
    except x509.ExtensionNotFound:
        return 0
