"""What a store takes in of what is signed, deletions included, and what it says of the rest."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from msgspec import structs

from cli.certificates.identity import Identity
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.keyspace import FACT, STOP
from keyexpr_schema.payloads.stops import StopAddress
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.attachments import Attachment, Signature
from keyexpr_schema.transport.certificates import Certificates, NotBelieved
from keyexpr_schema.transport.samples import Encoded
from keyexpr_schema.transport.signatures import FRESH_S
from keyexpr_schema.transport.stamps import stamp_of, ticks_of_time
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.storage import Write
from tests.support.certified import GOAL, NOW_S, STAMP, Certified, value_at


@pytest.fixture(scope="module")
def all_of_us(tmp_path_factory: pytest.TempPathFactory) -> Certified:
    return Certified(tmp_path_factory.mktemp("certs"))


class Judging:
    """A store, and what it takes in."""

    def __init__(self, store: SqliteStore, us: Certified) -> None:
        self.store, self.us = store, us
        self.admission = Admission(
            store, now_s=lambda: NOW_S, stamped_s=lambda: NOW_S, authority=us.authority
        )

    def takes(self, write: Write, attachment: Attachment) -> bool:
        judged = self.admission.judged(write, attachment)
        taken = [] if judged is None else self.admission.admitted([judged])
        return bool(taken and self.store.apply(taken))

    def why(self, write: Write) -> str:
        refused = self.admission.refused(write.keyexpr)
        assert refused is not None
        return refused.why


@pytest.fixture
def judging(tmp_path: Path, all_of_us: Certified) -> Iterator[Judging]:
    with SqliteStore(tmp_path) as store:
        yield Judging(store, all_of_us)


def stamp(at_s: float, session: int) -> int:
    return stamp_of(ticks_of_time(NOW_S + at_s), session)


def said(value: Encoded, at: int, received: int = 0) -> Write:
    return Write(value.keyexpr, at, False, value.encoding, value.data, 12, received)


def deletion(keyexpr: str, at: int = STAMP, received: int = 0) -> Write:
    return Write(keyexpr, at, True, "", b"", 0, received)


def fact(value: str, source: str, by: str = "") -> Encoded:
    told = Fact(subject="cup", relation="at", value=value, source=source, by=by)
    return value_at(FACT, FactAddress.of(told.key), told)


def test_who_deletes_signs_it_and_may_do_so(judging: Judging) -> None:
    us, at, before = judging.us, GOAL.keyexpr, stamp(-2.0, 7)
    assert judging.takes(said(GOAL, before), us.signed("operator.ana", GOAL, before))
    gone = deletion(at)
    refused = {
        "nobody has signed that it is deleted, and who deletes it has to": Attachment(),
        "robot.hsr may not write goals/g1/spec, which is for people": us.deletes("robot.hsr", at),
        "it is not what operator.ana has signed: another value, key or time stamp": us.signed(
            "operator.ana", GOAL
        ),
    }
    for why, attachment in refused.items():
        assert not judging.takes(gone, attachment)
        assert judging.why(gone) == why
    other = us.deletes("operator.ana", "home/goals/g2/spec")
    assert not judging.takes(gone, other)
    old = stamp(-FRESH_S - 1.0, 7)
    assert not judging.takes(deletion(at, old), us.deletes("operator.ana", at, old))
    assert "it was signed 3601 s ago" in judging.why(gone)
    assert judging.takes(gone, us.deletes("operator.bob", at))  # goals are everybody's to delete
    # A signature that says that something is deleted says nothing else.
    empty = Encoded(at, b"", GOAL.encoding)
    judge = us.authority.objection
    assert "not what operator.ana has signed" in str(
        judge(empty, STAMP, us.deletes("operator.ana", at))
    )


def test_a_stop_ends_when_that_is_signed_now_and_not_when_somebody_sends_it_later(
    judging: Judging,
) -> None:
    at = f"home/{STOP.build(StopAddress('s1'))}"
    signed = judging.us.deletes("operator.ana", at)
    judge = judging.us.authority.judge
    gone = Encoded(at, b"", "")
    assert judge(gone, STAMP, signed, deleted=True) == ("operator.ana", None)
    assert "not what" in str(judge(gone, STAMP + 1, signed, deleted=True).objection)


def test_what_is_over_the_planner_deletes_and_nobody_else(judging: Judging) -> None:
    us = judging.us
    for rest in ("goals/g1/*", "plans/p1/**", "robots/*/reports/p1/**", "closures/c1"):
        at = f"home/{rest}"
        assert us.authority.judge(Encoded(at, b"", ""), STAMP, Attachment(), deleted=True).objection
        assert judging.admission.judged(deletion(at), us.deletes("planner", at)) is not None
        by_bob = judging.admission.judged(deletion(at), us.deletes("operator.bob", at))
        assert (by_bob is not None) is (rest == "closures/c1")
    assert "operator.bob may not delete robots/*/reports/p1/**, which is for the planner" in (
        judging.why(deletion("home/robots/*/reports/p1/**"))
    )


def test_said_again_neither_a_word_nor_a_deletion_is_the_last_word(judging: Judging) -> None:
    us, hall, kitchen = judging.us, fact("hall", "hsr"), fact("kitchen", "person", "ana")
    at = hall.keyexpr
    ana, hsr = itertools.count(), itertools.count()

    def says(name: str, value: Encoded | None, when: int, session: int) -> tuple[Write, Attachment]:
        made = stamp(-10.0 + when, session)
        if value is None:
            return deletion(at, made, judging.store.receipt()), us.deletes(name, at, made)
        return said(value, made, judging.store.receipt()), us.signed(name, value, made)

    def again(told: tuple[Write, Attachment]) -> bool:
        write, attachment = told
        now = judging.store.receipt() + 1_000_000
        return judging.takes(structs.replace(write, received=now), attachment)

    first = says("operator.ana", kitchen, next(ana), 7)
    assert judging.takes(*first)
    assert judging.takes(*says("robot.hsr", hall, next(hsr), 8))
    assert not again(first)
    gone = says("operator.ana", None, next(ana), 7)
    assert judging.takes(*gone)
    assert judging.takes(*says("robot.hsr", hall, next(hsr), 8))
    assert not again(gone)
    assert not again(first)
    (there,) = judging.store.newest([at])
    assert there is not None
    assert (there.deleted, there.data) == (False, hall.data)


def test_why_a_write_is_not_taken_in_is_why_that_one_is_not(judging: Judging) -> None:
    forged = judging.us.signed("operator.bob", GOAL)
    assert not judging.takes(said(GOAL, STAMP), forged)
    later = stamp(0.0, 9)
    assert judging.takes(said(GOAL, later), judging.us.signed("operator.ana", GOAL, later))
    older = said(GOAL, stamp(-2.0, 9))
    assert judging.admission.why_not(older) == "somebody has written it later"
    assert judging.admission.why_not(said(GOAL, stamp(1.0, 9))) is None
    ahead = said(GOAL, stamp(3600.0, 9))
    assert "ahead of the clock here" in str(judging.admission.why_not(ahead))


class Roots(list[x509.Certificate]):
    """Counts how often it was asked whether one of these has signed something."""

    asked = 0

    def __iter__(self) -> Iterator[x509.Certificate]:
        self.asked += 1
        return super().__iter__()


def test_garbage_is_looked_at_once(all_of_us: Certified) -> None:
    roots = Roots(all_of_us.roots)
    certificates = Certificates(roots)
    roots.asked = 0
    file = all_of_us.office.files(Identity.parse("operator.ana")).certificate
    true = x509.load_pem_x509_certificate(file.read_bytes()).public_bytes(Encoding.DER)
    for odd in (b"", b"garbage", true[:-1], true + b"x", b"\x30\x82\xff\xff" + bytes(65535)):
        with pytest.raises(NotBelieved, match="is no certificate"):
            certificates.holder(odd)
    bent = true[:-1] + bytes([true[-1] ^ 1])
    assert roots.asked == 0
    for _ in range(3):
        with pytest.raises(NotBelieved, match=r"'operator\.ana' is not of this fleet's authority"):
            certificates.holder(bent)
    assert roots.asked == 1
    for _ in range(2):
        assert certificates.holder(true).name == "operator.ana"
    assert roots.asked == 2


def test_a_signature_takes_room_while_it_waits() -> None:
    assert Attachment(3).size == 0
    assert Attachment(3, Signature(b"12", b"345")).size == 5
