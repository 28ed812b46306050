"""Who a process is by the certificate in its Zenoh configuration: its name, its key, and who else
is believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from keyexpr_schema.errors import BadZenohConfig
from keyexpr_schema.principals import ROUTER, Principal
from keyexpr_schema.transport.attachments import Attach, unsigned
from keyexpr_schema.transport.live_signatures import LiveSignatures
from keyexpr_schema.transport.signatures import Authority, Signer
from keyexpr_schema.transport.zenoh_file import ZenohFile, said_in

_TLS = "transport/link/tls"


@dataclass(frozen=True)
class Credentials:
    """`name` is the common name of a certificate. Without an `authority` nobody's word is checked:
    the configuration asks for no certificates of others."""

    name: str
    signer: Signer | None
    authority: Authority | None

    @property
    def principal(self) -> Principal | None:
        """Who that is; `None`: a router."""
        return Principal.certified(self.name)


def attaching(credentials: Credentials | None, realm: str) -> Attach:
    """What the values of one with these carry with them, on key expressions without realm."""
    if credentials is None or credentials.signer is None:
        return unsigned
    attachment = credentials.signer.attachment
    return lambda keyexpr, *said: attachment(f"{realm}/{keyexpr}", *said)


def judging(
    credentials: Credentials | None, realm: str, linked_s: Callable[[], float]
) -> Callable[[], LiveSignatures | None]:
    """What makes a judge of what a watch hears; `linked_s`: for how long the link is up [s]."""
    if credentials is None or (authority := credentials.authority) is None:
        return lambda: None
    return lambda: LiveSignatures(authority, realm, linked_s)


def of_client(file: ZenohFile | None) -> Credentials | None:
    """Those of what connects to a router; `None`: there are none, or of nobody of ours.

    Raises:
        BadZenohConfig: the certificate, its key or the authority cannot be read.
    """
    name = certified_name(file, "connect")
    if file is None or name is None or Principal.certified(name) is None:
        return None
    return _credentials(file, "connect", name, None)


def of_router(file: ZenohFile | None) -> Credentials | None:
    """Those of a router, which knows by its access control who is believed; `None`: as `of_client`.

    Raises:
        BadZenohConfig: as `of_client`.
    """
    name = certified_name(file, "listen")
    if file is None or name is None or name.partition(".")[0] != ROUTER:
        return None
    subjects = said_in(file.config(), "access_control/subjects") or ()
    known = {name for each in subjects for name in each.get("cert_common_names") or ()}
    return _credentials(file, "listen", name, frozenset(known) if known else None)


def certified_name(
    file: ZenohFile | None, which: Literal["connect", "listen"] = "connect"
) -> str | None:
    """The common name in a configuration's certificate, if it has one.

    Raises:
        BadZenohConfig: it cannot be read.
    """
    path = None if file is None else said_in(file.config(), f"{_TLS}/{which}_certificate")
    if file is None or not isinstance(path, str):
        return None
    # Some tens of milliseconds to import, for those who have certificates.
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    try:
        certificate = x509.load_pem_x509_certificate(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise BadZenohConfig(f"{file.path}: the certificate {path} cannot be read: {why}") from None
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else None


def _credentials(
    file: ZenohFile, which: str, name: str, known: frozenset[str] | None
) -> Credentials:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

    config = file.config()

    def read(what: str) -> bytes | None:
        path = said_in(config, f"{_TLS}/{what}")
        return Path(path).read_bytes() if isinstance(path, str) else None

    try:
        signer = authority = None
        certificate, private = read(f"{which}_certificate"), read(f"{which}_private_key")
        if certificate is not None and private is not None:
            key = load_pem_private_key(private, None)
            if not isinstance(key, ec.EllipticCurvePrivateKey):
                raise ValueError("it is none of an elliptic curve, as `robotctl certs` makes them")
            der = x509.load_pem_x509_certificate(certificate).public_bytes(Encoding.DER)
            signer = Signer(der, key)
        roots = read("root_ca_certificate")
        if roots is not None and said_in(config, f"{_TLS}/enable_mtls") is True:
            authority = Authority(x509.load_pem_x509_certificates(roots), known)
    except (OSError, ValueError, TypeError) as error:
        raise BadZenohConfig(
            f"{file.path}: the key of {name} or its authority cannot be read: {error}"
        ) from None
    return Credentials(name, signer, authority)
