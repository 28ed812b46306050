"""Whose certificates are believed: those that the authority itself has signed, and not taken back.

Who sends garbage should not cost much. So what is cheap is looked at first, and what was found is
kept, of those who are believed as of those who are not.
"""

from __future__ import annotations

import hashlib
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from keyexpr_schema.principals import ROUTER, Principal
from keyexpr_schema.transport.revocations import RevokedCertificates
from keyexpr_schema.transport.signing_keys import Verify, verifying

if TYPE_CHECKING:
    from cryptography import x509

KNOWN = 1000
"""Certificates of which it is kept what was found, of those who are believed and of the others."""
LONGEST = 4_096
"""Bytes of a certificate; ours take some 500, and a router's as much more as it has names."""
LONGEST_WHY = 200
"""Characters of why one is not believed, as far as it is kept."""


class Holder(NamedTuple):
    """Whose a certificate is, what verifies with its key, when it is valid [s, Unix], and by what
    it is known: its issuer's name, in DER, and its serial number."""

    name: str
    verify: Verify
    from_s: float
    until_s: float
    known_by: tuple[bytes, int]


class NotBelieved(Exception):
    """Why a signature or a certificate says nothing; the message is part of a sentence."""


class Certificates:
    """Those that one of `roots` has signed directly, of whom is `known` (`None`: nobody has said
    who is). Thread-safe."""

    def __init__(
        self,
        roots: Sequence[x509.Certificate],
        known: frozenset[str] | None = None,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._roots, self._known, self._now_s = roots, known, now_s
        self._issuers = [root.subject.public_bytes() for root in roots]
        self.revoked = RevokedCertificates(roots)
        self._lock = threading.Lock()
        self._holders: dict[bytes, Holder] = {}
        self._refused: OrderedDict[bytes, str] = OrderedDict()
        """Why, by the digest of the certificate."""

    def holder(self, certificate: bytes) -> Holder:
        """Whose a certificate (DER) is, if it is valid now.

        Raises:
            NotBelieved: it is not, or it is none.
        """
        holder = self._holders.get(certificate)
        if holder is None:
            with self._lock:
                holder = self._found(certificate)
        if holder.known_by in self.revoked:
            raise NotBelieved(f"the certificate of {holder.name}, who has signed it, is revoked")
        now_s = self._now_s()
        if not holder.from_s <= now_s <= holder.until_s:
            when = "has expired" if now_s > holder.until_s else "is not valid yet"
            raise NotBelieved(f"the certificate of {holder.name}, who has signed it, {when}")
        return holder

    def _found(self, certificate: bytes) -> Holder:
        """Whose one is that was not believed so far; what is found is kept."""
        if not _looks_like_one(certificate):
            raise NotBelieved("what it is signed with is no certificate")
        digest = hashlib.sha256(certificate).digest()
        if (why := self._refused.get(digest)) is not None:
            self._refused.move_to_end(digest)
            raise NotBelieved(why)
        try:
            holder = self._certified(certificate)
        except NotBelieved as error:
            self._refused[digest] = str(error)[:LONGEST_WHY]
            if len(self._refused) > KNOWN:
                self._refused.popitem(last=False)
            raise
        if len(self._holders) >= KNOWN:
            self._holders.clear()
        self._holders[certificate] = holder
        return holder

    def _certified(self, certificate: bytes) -> Holder:
        from cryptography import x509
        from cryptography.exceptions import InvalidSignature
        from cryptography.x509.oid import NameOID

        try:
            found = x509.load_der_x509_certificate(certificate)
            names = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
            (name,) = (str(each.value) for each in names)
            key = found.public_key()
        except Exception:  # whatever a parser of somebody's bytes raises
            raise NotBelieved("what it is signed with is no certificate") from None
        ours = any(issuer in certificate for issuer in self._issuers)
        for root in self._roots if ours else ():
            try:
                found.verify_directly_issued_by(root)
                break
            except (ValueError, TypeError, InvalidSignature):
                continue
        else:
            raise NotBelieved(f"the certificate of {name!r} is not of this fleet's authority")
        if Principal.certified(name) is None and name.partition(".")[0] != ROUTER:
            raise NotBelieved(f"{name}, whose certificate it is, is nobody of the fleet")
        try:
            verify = verifying(key)
        except ValueError as error:
            raise NotBelieved(f"the key of {name} is of no use: {error}") from None
        if self._known is not None and name not in self._known:
            raise NotBelieved(f"the router does not know {name}, or no more")
        return Holder(
            name,
            verify,
            max(found.not_valid_before_utc, root.not_valid_before_utc).timestamp(),
            min(found.not_valid_after_utc, root.not_valid_after_utc).timestamp(),
            (found.issuer.public_bytes(), found.serial_number),
        )


def _looks_like_one(certificate: bytes) -> bool:
    """Whether it begins as a certificate in DER does (X.690, 8.1.3: a sequence whose length takes
    two bytes), and is as long as it says."""
    said = int.from_bytes(certificate[2:4], "big")
    return certificate[:2] == b"\x30\x82" and len(certificate) == said + 4 <= LONGEST
