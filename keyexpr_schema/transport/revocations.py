"""Which certificates an authority has taken back: its list of them (X.509 CRL; RFC 5280, 5).

The authority signs the list, so whoever brings it is believed, and what is true of it in one place
is true everywhere. A later list has a higher number. What was revoked once is so for good: nobody
who has heard of it believes it again, whatever he is shown later.
"""

from __future__ import annotations

import hashlib
from base64 import b64decode, b64encode
from collections.abc import Sequence
from typing import TYPE_CHECKING

from keyexpr_schema.payloads.system import AuthorityAddress, Revocations

if TYPE_CHECKING:
    from cryptography import x509

_END = b"-----END X509 CRL-----"


class BadList(ValueError):
    """Why a list says nothing; the message is part of a sentence."""


def authority_id(issuer: bytes) -> str:
    """By which the key of an authority's list names it, from its name in DER."""
    return hashlib.sha256(issuer).hexdigest()[:16]


def shown(list_: x509.CertificateRevocationList) -> tuple[AuthorityAddress, Revocations]:
    """A list as it stands on its key."""
    from cryptography.hazmat.primitives.serialization import Encoding

    der = list_.public_bytes(Encoding.DER)
    issuer = authority_id(list_.issuer.public_bytes())
    return AuthorityAddress(issuer), Revocations(crl=b64encode(der).decode())


def lists_in(data: bytes) -> list[x509.CertificateRevocationList]:
    """Those in a file, in PEM, or one in DER.

    Raises:
        ValueError: there is something else in it.
    """
    from cryptography import x509

    if _END not in data:
        return [x509.load_der_x509_crl(data)]
    blocks = [each + _END for each in data.split(_END) if each.strip()]
    return [x509.load_pem_x509_crl(each) for each in blocks]


class RevokedCertificates:
    """What the lists of `roots` say. True to `in`: an issuer's name (DER), and a serial number."""

    def __init__(self, roots: Sequence[x509.Certificate]) -> None:
        self._roots = {root.subject.public_bytes(): root for root in roots}
        self._numbers: dict[bytes, int] = {}
        self._revoked: set[tuple[bytes, int]] = set()

    def __contains__(self, certificate: tuple[bytes, int]) -> bool:
        return certificate in self._revoked

    def learn(self, list_: x509.CertificateRevocationList) -> bool:
        """Take in what a list says; whether it is as late as any that was seen.

        Raises:
            BadList: it is none of these authorities.
        """
        from cryptography import x509

        issuer = list_.issuer.public_bytes()
        root = self._roots.get(issuer)
        try:
            key = None if root is None else root.public_key()
            valid = key is not None and list_.is_signature_valid(key)  # type: ignore[arg-type]
            found = list_.extensions.get_extension_for_class(x509.CRLNumber)
        except x509.ExtensionNotFound:
            raise BadList("it has no number") from None
        except Exception:  # whatever a library raises over somebody's bytes
            valid = False
        if not valid:
            raise BadList("it is not signed by this fleet's authority")
        number, known = found.value.crl_number, self._numbers.get(issuer, -1)
        if number > known:
            self._numbers[issuer] = number
            self._revoked.update((issuer, each.serial_number) for each in list_)
        return number >= known

    def objection(self, address: AuthorityAddress, value: Revocations) -> str | None:
        """Take in what stands on the key of a list, or what is to stand there; why it may not, if
        it may not."""
        from cryptography import x509

        try:
            list_ = x509.load_der_x509_crl(b64decode(value.crl, validate=True))
            if authority_id(list_.issuer.public_bytes()) != address.authority:
                return "it is the list of another authority than its key says"
            late = self.learn(list_)
        except BadList as error:
            return f"{error}"
        except Exception:
            return "it is no list of revoked certificates (X.509 CRL, DER in base64)"
        return None if late else "there is a later list of revoked certificates"
