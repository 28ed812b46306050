"""Who a process is by the certificate in its Zenoh configuration: its name, its key, and who else
is believed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from keyexpr_schema.errors import BadZenohConfig
from keyexpr_schema.principals import ROUTER, Principal
from keyexpr_schema.transport.attachments import Attach, unsigned
from keyexpr_schema.transport.live_signatures import Judges
from keyexpr_schema.transport.revocations import lists_in
from keyexpr_schema.transport.router_presence import RouterPresence
from keyexpr_schema.transport.signatures import Authority, Signer
from keyexpr_schema.transport.trace import Trace
from keyexpr_schema.transport.zenoh_file import ZenohFile, said_in

_TLS = "transport/link/tls"
REVOKED_SUFFIX = ".crl"
"""A file beside that of the authority, with this suffix, has what it had revoked by then."""


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
    credentials: Credentials | None, realm: str, router: RouterPresence, trace: Trace
) -> Judges | None:
    """What makes judges of what watches hear, on a link to `router`."""
    if credentials is None or (authority := credentials.authority) is None:
        return None
    return Judges(authority, realm, router, trace)


@lru_cache(maxsize=1)
def of_client(file: ZenohFile | None) -> Credentials | None:
    """Those of what connects to a router; `None`: there are none, or of nobody of ours.

    They are read once from what was read once.

    Raises:
        BadZenohConfig: the certificate, its key or the authority cannot be read.
    """
    found = _certificate(file, "connect")
    if file is None or found is None or Principal.certified(found.name) is None:
        return None
    return _credentials(file, "connect", found, None)


def of_router(file: ZenohFile | None) -> Credentials | None:
    """Those of a router, which knows by its access control who is believed; `None`: as `of_client`.

    Raises:
        BadZenohConfig: as `of_client`.
    """
    found = _certificate(file, "listen")
    if file is None or found is None or found.name.partition(".")[0] != ROUTER:
        return None
    subjects = said_in(file.config(), "access_control/subjects") or ()
    known = {name for each in subjects for name in each.get("cert_common_names") or ()}
    return _credentials(file, "listen", found, frozenset(known) if known else None)


class _Certificate(NamedTuple):
    """The common name in a certificate, and all of it, in DER."""

    name: str
    der: bytes


def _certificate(file: ZenohFile | None, which: str) -> _Certificate | None:
    """That in a configuration, if it has one that names somebody.

    Raises:
        BadZenohConfig: it cannot be read.
    """
    path = None if file is None else said_in(file.config(), f"{_TLS}/{which}_certificate")
    if file is None or not isinstance(path, str):
        return None
    # Some tens of milliseconds to import, for those who have certificates.
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding
    from cryptography.x509.oid import NameOID

    try:
        found = x509.load_pem_x509_certificate(Path(path).read_bytes())
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise BadZenohConfig(f"{file.path}: the certificate {path} cannot be read: {why}") from None
    names = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return _Certificate(str(names[0].value), found.public_bytes(Encoding.DER)) if names else None


def _credentials(
    file: ZenohFile, which: str, ours: _Certificate, known: frozenset[str] | None
) -> Credentials:
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    config = file.config()

    signer = authority = None
    key = said_in(config, f"{_TLS}/{which}_private_key")
    roots = said_in(config, f"{_TLS}/root_ca_certificate")
    what = f"the key {key} of {ours.name}"
    try:
        if isinstance(key, str):
            signer = Signer(ours.der, load_pem_private_key(Path(key).read_bytes(), None))
        what = f"the authority {roots}"
        if isinstance(roots, str) and said_in(config, f"{_TLS}/enable_mtls") is True:
            authority = Authority(x509.load_pem_x509_certificates(Path(roots).read_bytes()), known)
            revoked = Path(roots).with_suffix(REVOKED_SUFFIX)
            what = f"the list of revoked certificates {revoked}"
            for each in lists_in(revoked.read_bytes()) if revoked.exists() else ():
                authority.revoked.learn(each)
    except (OSError, ValueError, TypeError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise BadZenohConfig(f"{file.path}: {what} cannot be used: {why}") from None
    return Credentials(ours.name, signer, authority)
