"""Signatures: that who a value says that it is from has said it, of this key, at this time.

Zenoh tells a receiver not who has sent something. So who has a certificate signs what it puts on
keys that name somebody (`authors.is_signed`), and that it deletes them, with the key of that
certificate (`signing_keys`): realm, key, time stamp, lateness, and the bytes (`_said`). Signature
and certificate travel beside the value. `Authority.judge` is the one place where they are judged.

Somebody else may send again what was signed, and no more than that: the same words on the same key
with the same stamp. Where stamps order a key that changes nothing. Where receipts do it would be
the last word again, and where a deletion was forgotten it would be new: so a store takes in what
was signed for `FRESH_S`, for which it remembers deletions, and of one session only if it is later
than what that said before of the key (`Heard`). Watches ask the store earlier (`LiveSignatures`).

The library `cryptography` is imported where there is a certificate, and nowhere else.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from keyexpr_schema.authors import is_signed, names_in
from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.key import Component
from keyexpr_schema.keyspace import REVOCATIONS, STOP, STORE_REPLACE
from keyexpr_schema.principals import ROUTER, Principal
from keyexpr_schema.transport.attachments import Attachment, Signature
from keyexpr_schema.transport.certificates import Certificates, NotBelieved
from keyexpr_schema.transport.samples import Encoded, decode_value
from keyexpr_schema.transport.signing_keys import signing
from keyexpr_schema.transport.stamps import text_of_stamp, time_s_of_stamp
from keyexpr_schema.transport.store.storage import deletes_tree, stored_key

if TYPE_CHECKING:
    from cryptography import x509

FRESH_S = 3600.0
"""So old [s] may be what a store takes in; who waits for longer says it again, with a new stamp.
Clocks that somebody sets are seldom further off, and deletions are remembered for days."""


def has_signature(keyexpr: str, *, deleted: bool) -> bool:
    """Whether who writes this, or deletes it, has to sign that; `keyexpr` with its realm.

    Of what the planner deletes by one message, with wildcards, some may be others'. Who has the
    store write something signs the question.
    """
    key = stored_key(keyexpr)
    if key is None:
        return deleted and deletes_tree(keyexpr)
    return key is STORE_REPLACE or is_signed(key)


def _said(keyexpr: str, stamp: str, late_us: int | None, data: bytes | None) -> bytes:
    """What is signed; `keyexpr` with its realm, `data` None: that it is deleted.

    A stop holds whatever the clock of its writer shows: Zenoh gives it another stamp where that is
    ahead, and robots stop all the same.
    """
    late = "" if late_us is None else str(late_us)
    if data is None:
        return f"robotfleet deletes\n{keyexpr}\n{stamp}\n{late}\n".encode()
    at = "" if stored_key(keyexpr) is STOP else stamp
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
        if not has_signature(keyexpr, deleted=data is None):
            return Attachment(late_us).text()
        value = self._sign(_said(keyexpr, stamp, late_us, data))
        return Attachment(late_us, Signature(value, self._certificate)).text()


class Judged(NamedTuple):
    """The common name of who has signed something; why it is not taken in, if it is not."""

    by: str = ""
    objection: str | None = None


class Authority:
    """Judges what is signed. `roots` certify directly; of whom `known` has not, nothing is taken
    (`None`: nobody has said who is known), nor what is signed with a revoked certificate."""

    def __init__(
        self,
        roots: Sequence[x509.Certificate],
        known: frozenset[str] | None = None,
        now_s: Callable[[], float] = time.time,
    ) -> None:
        self._certificates, self._now_s = Certificates(roots, known, now_s), now_s
        self.revoked = self._certificates.revoked

    def objection(self, value: Encoded, stamp: int, attachment: Attachment) -> str | None:
        """Why a value is not from whom it says, if it is not; its key names the realm."""
        return self.judge(value, stamp, attachment).objection

    def judge(
        self, value: Encoded, stamp: int, attachment: Attachment, *, deleted: bool = False
    ) -> Judged:
        """By whom a value is, or that it is deleted, whose key names the realm.

        Of keys that nobody signs there is nothing to say, but of the lists of what is revoked:
        these the authority has signed itself.
        """
        if stored_key(value.keyexpr) is REVOCATIONS:
            return Judged("", self._objection_to_list(value, deleted))
        if not has_signature(value.keyexpr, deleted=deleted):
            return Judged()
        try:
            who = self._signer(value, stamp, attachment, deleted)
        except NotBelieved as error:
            return Judged("", str(error))
        if deleted:
            return Judged(who, _objection_to_deletion(who, value.keyexpr))
        return Judged(who, objection_to_names(who, value))

    def _objection_to_list(self, value: Encoded, deleted: bool) -> str | None:
        if deleted:
            return "what is revoked stays so: a list is not deleted, a later one takes its place"
        try:
            found = decode_value(REVOCATIONS, value)
        except UndecodablePayload as error:
            return str(error)
        address = REVOCATIONS.parse(value.keyexpr.partition("/")[2])
        return self.revoked.objection(address, found)

    def too_old(self, keyexpr: str, stamp: int, *, deleted: bool = False) -> str | None:
        """Why a store does not take something in any more, if it does not."""
        age_s = self._now_s() - time_s_of_stamp(stamp)
        if age_s <= FRESH_S or not has_signature(keyexpr, deleted=deleted):
            return None
        if stored_key(keyexpr) is STOP and not deleted:
            return None
        return (
            f"it was signed {age_s:.0f} s ago, and {FRESH_S:.0f} s are the most; if that was now, "
            "the clock of its writer or of the router is wrong"
        )

    def _signer(self, value: Encoded, stamp: int, attachment: Attachment, deleted: bool) -> str:
        """The common name of who has signed it."""
        from cryptography.exceptions import InvalidSignature

        if attachment.signature is None:
            if deleted:
                raise NotBelieved("nobody has signed that it is deleted, and who deletes it has to")
            raise NotBelieved("nobody has signed it, and who names somebody there has to")
        holder = self._certificates.holder(attachment.signature.certificate)
        data = None if deleted else value.data
        said = _said(value.keyexpr, text_of_stamp(stamp), attachment.late_us, data)
        try:
            holder.verify(attachment.signature.value, said)
        except InvalidSignature:
            raise NotBelieved(
                f"it is not what {holder.name} has signed: another value, key or time stamp"
            ) from None
        return holder.name


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


def _objection_to_deletion(who: str, keyexpr: str) -> str | None:
    """Why one with this common name may not delete a key; `None`: it may, as the table says."""
    if who.partition(".")[0] == ROUTER:
        return None
    principal, key = Principal.certified(who), stored_key(keyexpr)
    if principal is None:
        return f"{who} is nobody of the fleet"
    rest = keyexpr.partition("/")[2]
    if key is not None:
        return principal.objection_to_delete(key, rest)
    if principal.roles & Component.PLANNER:
        return None
    return f"{who} may not delete {rest}, which is for the planner"
