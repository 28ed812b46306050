"""Signatures: that who a value says that it is from has said it, of this key, at this time.

Zenoh tells a receiver not who has sent something. So who has a certificate signs what it puts on
keys that name somebody (`authors.is_signed`), with the key of that certificate (`signing_keys`):
realm, key, time stamp, lateness, and the bytes (`_said`). Signature and certificate travel beside
the value. `Authority.objection` is the one place where they are judged.

Somebody else may send again what was signed, and no more than that: the same words on the same key
with the same stamp. Where stamps order a key that changes nothing. Where receipts do it would be
the last word again, and where a deletion was forgotten it would be new: so a store takes in what
was signed for `FRESH_S`, for which it remembers deletions, and of one session only if it is later
than what that said before of the key (`Heard`). Watches ask the store earlier (`LiveSignatures`).

The library `cryptography` is imported where there is a certificate, and nowhere else.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from keyexpr_schema.authors import is_signed, names_in
from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.keyspace import STOP
from keyexpr_schema.principals import ROUTER, Principal
from keyexpr_schema.transport.attachments import Attachment, Signature
from keyexpr_schema.transport.samples import Encoded, decode_value
from keyexpr_schema.transport.signing_keys import Verify, signing, verifying
from keyexpr_schema.transport.stamps import (
    source_of_stamp,
    text_of_stamp,
    time_s_of_stamp,
)
from keyexpr_schema.transport.store.storage import stored_key

if TYPE_CHECKING:
    from cryptography import x509

FRESH_S = 3600.0
"""So old [s] may be what a store takes in; who waits for longer says it again, with a new stamp.
Clocks that somebody sets are seldom further off, and deletions are remembered for days."""
KNOWN = 1000
"""Certificates, and 50 times as many keys, of which it is remembered what was found."""


def _said(keyexpr: str, stamp: str, late_us: int | None, data: bytes) -> bytes:
    """What is signed; `keyexpr` with its realm.

    A stop holds whatever the clock of its writer shows: Zenoh gives it another stamp where that is
    ahead, and robots stop all the same.
    """
    at = "" if stored_key(keyexpr) is STOP else stamp
    late = "" if late_us is None else str(late_us)
    return f"robotfleet says\n{keyexpr}\n{at}\n{late}\n".encode() + data


class Signer:
    """Signs with the key of a certificate."""

    def __init__(self, certificate: bytes, key: object) -> None:
        """`certificate` in DER.

        Raises:
            ValueError: such a key does not sign; see `signing_keys`.
        """
        self._certificate, self._sign = certificate, signing(key)

    def attachment(
        self, keyexpr: str, stamp: str, data: bytes | None, late_us: int | None = None
    ) -> str | None:
        """What goes beside a value at `keyexpr`, which names its realm; see `Attach`."""
        key = stored_key(keyexpr)
        if data is None or key is None or not is_signed(key):
            return Attachment(late_us).text()
        value = self._sign(_said(keyexpr, stamp, late_us, data))
        return Attachment(late_us, Signature(value, self._certificate)).text()


class _Holder(NamedTuple):
    """Whose a certificate is, what verifies with its key, and when it is valid [s, Unix]."""

    name: str
    verify: Verify
    from_s: float
    until_s: float


class _NotBelieved(Exception):
    """Why a signature or a certificate says nothing; the message is part of a sentence."""


class Authority:
    """Judges what is signed. `roots` certify directly; of whom `known` has not, nothing is taken
    (`None`: nobody has said who is known). For one thread at a time."""

    def __init__(
        self,
        roots: Sequence[x509.Certificate],
        known: frozenset[str] | None = None,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._roots, self._known, self._now_s = roots, known, now_s
        self._holders: dict[bytes, _Holder] = {}

    def objection(self, value: Encoded, stamp: int, attachment: Attachment) -> str | None:
        """Why a value is not from whom it says, if it is not; its key names the realm.

        Of keys that nobody signs there is nothing to say.
        """
        key = stored_key(value.keyexpr)
        if key is None or not is_signed(key):
            return None
        try:
            who = self._signer(value, stamp, attachment)
        except _NotBelieved as error:
            return str(error)
        return objection_to_names(who, value)

    def too_old(self, value: Encoded, stamp: int) -> str | None:
        """Why a value is not taken in any more by a store, if it is not."""
        key, age_s = stored_key(value.keyexpr), self._now_s() - time_s_of_stamp(stamp)
        if key is None or key is STOP or not is_signed(key) or age_s <= FRESH_S:
            return None
        return (
            f"it was signed {age_s:.0f} s ago, and {FRESH_S:.0f} s are the most; if that was now, "
            "the clock of its writer or of the router is wrong"
        )

    def _signer(self, value: Encoded, stamp: int, attachment: Attachment) -> str:
        """The common name of who has signed it."""
        from cryptography.exceptions import InvalidSignature

        if attachment.signature is None:
            raise _NotBelieved("nobody has signed it, and who names somebody there has to")
        holder = self._holder(attachment.signature.certificate)
        said = _said(value.keyexpr, text_of_stamp(stamp), attachment.late_us, value.data)
        try:
            holder.verify(attachment.signature.value, said)
        except InvalidSignature:
            raise _NotBelieved(
                f"it is not what {holder.name} has signed: another value, key or time stamp"
            ) from None
        return holder.name

    def _holder(self, certificate: bytes) -> _Holder:
        """Whose a certificate is, if it is valid now."""
        holder = self._holders.get(certificate)
        if holder is None:
            holder = self._certified(certificate)
            if len(self._holders) >= KNOWN:
                self._holders.clear()
            self._holders[certificate] = holder
        now_s = self._now_s()
        if not holder.from_s <= now_s <= holder.until_s:
            when = "has expired" if now_s > holder.until_s else "is not valid yet"
            raise _NotBelieved(f"the certificate of {holder.name}, who has signed it, {when}")
        return holder

    def _certified(self, certificate: bytes) -> _Holder:
        """Whose a certificate is that one of the roots has signed."""
        from cryptography import x509
        from cryptography.exceptions import InvalidSignature
        from cryptography.x509.oid import NameOID

        try:
            found = x509.load_der_x509_certificate(certificate)
            names = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
            (name,) = (str(each.value) for each in names)
            key = found.public_key()
        except Exception:  # whatever a parser of somebody's bytes raises
            raise _NotBelieved("what it is signed with is no certificate") from None
        for root in self._roots:
            try:
                found.verify_directly_issued_by(root)
                break
            except (ValueError, TypeError, InvalidSignature):
                continue
        else:
            raise _NotBelieved(f"the certificate of {name!r} is not of this fleet's authority")
        try:
            verify = verifying(key)
        except ValueError as error:
            raise _NotBelieved(f"the key of {name} is of no use: {error}") from None
        if self._known is not None and name not in self._known:
            raise _NotBelieved(f"the router does not know {name}, or no more")
        return _Holder(
            name,
            verify,
            max(found.not_valid_before_utc, root.not_valid_before_utc).timestamp(),
            min(found.not_valid_after_utc, root.not_valid_after_utc).timestamp(),
        )


def objection_to_names(who: str, value: Encoded) -> str | None:
    """Why one with this common name may not say that a value is from whom it says; `None`: it may.

    Routers pass on what others said: compare and set. `value.keyexpr` names the realm.
    """
    key = stored_key(value.keyexpr)
    if key is None or not is_signed(key) or who.partition(".")[0] == ROUTER:
        return None
    try:
        names = names_in(decode_value(key, value))
    except UndecodablePayload as error:
        return str(error)
    principal = Principal.certified(who)
    if principal is None:
        return f"{who} is nobody of the fleet"
    address = key.parse(value.keyexpr.partition("/")[2])
    return principal.objection_to_names(names, getattr(address, "robot", None))


class Heard:
    """What was signed and taken in lately: the last stamp of each session, of each key."""

    def __init__(self) -> None:
        self._stamps: OrderedDict[tuple[str, int], int] = OrderedDict()

    def before(self, keyexpr: str, stamp: int) -> bool:
        """Whether that session has said this of the key before, or something later."""
        return stamp <= self._stamps.get((keyexpr, source_of_stamp(stamp)), -1)

    def note(self, keyexpr: str, stamp: int) -> None:
        """It was taken in."""
        said = (keyexpr, source_of_stamp(stamp))
        self._stamps[said] = max(stamp, self._stamps.pop(said, 0))
        oldest = next(iter(self._stamps.values()))
        late = time_s_of_stamp(stamp) - time_s_of_stamp(oldest) > 2 * FRESH_S
        if late or len(self._stamps) > 50 * KNOWN:
            self._stamps.popitem(last=False)

    def forget(self) -> None:
        """What was noted may not have been taken in."""
        self._stamps.clear()
