"""Who has signed a value, and what keeps it from being taken in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding

from cli.certificates.authority import Authority as Office
from cli.certificates.identity import Identity
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.authors import is_signed
from keyexpr_schema.errors import BadZenohConfig
from keyexpr_schema.key import Component, Delivery
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    KEYSPACE,
    ORDER,
    PLAN_SPEC,
    REPORT,
    SCHEDULE_SPEC,
    STOP,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.schedules import Schedule, ScheduleAddress
from keyexpr_schema.payloads.stops import Stop, StopAddress
from keyexpr_schema.payloads.tasks import Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.attachments import LONGEST, Attachment, Signature
from keyexpr_schema.transport.credentials import of_client
from keyexpr_schema.transport.samples import Encoded, encoding_of
from keyexpr_schema.transport.signatures import FRESH_S, Authority
from keyexpr_schema.transport.stamps import stamp_of, text_of_stamp, ticks_of_time
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.zenoh_file import read_zenoh_file
from tests.support.certified import (
    ANA_WANTS,
    GOAL,
    NOW,
    NOW_S,
    STAMP,
    Certified,
    value_at,
)
from tests.support.other_keys import OtherKey, rekey

BOB_WANTS = Goal(goal="g1", text="Bring the cup.", said_by="bob")


@pytest.fixture(scope="module")
def all_of_us(tmp_path_factory: pytest.TempPathFactory) -> Certified:
    return Certified(tmp_path_factory.mktemp("certs"))


def test_what_is_signed_follows_from_the_table() -> None:
    signed = {key for key in KEYSPACE if is_signed(key)}
    assert {GOAL_SPEC, FACT, SCHEDULE_SPEC, REPORT, STOP} <= signed
    assert {PLAN_SPEC, ORDER}.isdisjoint(signed)  # the planner's alone
    by_hand = {
        key
        for key in KEYSPACE
        if key.delivery is Delivery.STORED
        and key.writers == Component.PERSON
        and {"by", "said_by", "proposed_by"} & {*key.payload.__struct_fields__}
    }
    assert by_hand <= signed


def test_who_says_it_is_who_has_signed_it(all_of_us: Certified) -> None:
    assert all_of_us.objection("operator.ana", GOAL) is None
    nobody = value_at(GOAL_SPEC, GoalAddress("g1"), replace_by(ANA_WANTS, ""))
    assert all_of_us.objection("operator.bob", nobody) is None
    forged = "operator.bob has signed it, and it says that it is from 'ana', not bob"
    assert all_of_us.objection("operator.bob", GOAL) == forged
    inside = Schedule(schedule="s1", goal=ANA_WANTS)
    schedule = value_at(SCHEDULE_SPEC, ScheduleAddress("s1"), inside)
    assert all_of_us.objection("operator.bob", schedule) == forged


def replace_by(goal: Goal, by: str) -> Goal:
    return Goal(goal=goal.goal, text=goal.text, said_by=by)


@pytest.mark.parametrize(
    ("who", "source", "by", "fine"),
    [
        ("robot.hsr", "hsr", "", True),
        ("robot.hsr", "locobot", "", False),
        ("robot.hsr", "person", "", False),
        ("robot.hsr", "hsr", "ana", False),
        ("workers", "locobot", "", True),
        ("workers", "person", "", False),
        ("workers", "planner:g1", "", False),
        ("operator.ana", "person", "ana", True),
        ("operator.ana", "person", "bob", False),
        ("operator.ana", "hsr", "ana", False),
        ("planner", "person", "ana", True),
        ("planner", "planner:g1", "", True),
        ("router", "hsr", "", True),
    ],
)
def test_whose_facts_are_whose(
    all_of_us: Certified, who: str, source: str, by: str, fine: bool
) -> None:
    fact = Fact(subject="cup", relation="at", value="hall", source=source, by=by)
    told = all_of_us.objection(who, value_at(FACT, FactAddress.of(fact.key), fact))
    assert (told is None) is fine
    report = Report(
        robot="hsr", plan="p1", revision=1, task="t1", attempt=1, epoch=1, incarnation="i",
        state=ReportState.SUCCEEDED, facts=(fact,),
    )  # fmt: skip
    if who in ("robot.hsr", "workers"):  # only robots have any, each of its own
        told = all_of_us.objection(who, value_at(REPORT, ReportAddress.of(report), report))
        assert (told is None) is (source == "hsr" and not by)


def test_a_signature_is_of_one_value_one_key_and_one_time(all_of_us: Certified) -> None:
    signed = all_of_us.signed("operator.ana", GOAL)
    judge = all_of_us.authority.objection
    assert judge(GOAL, STAMP, signed) is None
    not_hers = "it is not what operator.ana has signed: another value, key or time stamp"
    other = value_at(GOAL_SPEC, GoalAddress("g1"), Goal(goal="g1", text="No.", said_by="ana"))
    elsewhere = replace(GOAL, keyexpr="home/goals/g2/spec")
    for changed in (other, elsewhere, replace(GOAL, keyexpr="garden/goals/g1/spec")):
        assert judge(changed, STAMP, signed) == not_hers
    assert judge(GOAL, STAMP + 1, signed) == not_hers
    assert judge(GOAL, STAMP, Attachment(13, signed.signature)) == not_hers
    assert judge(GOAL, STAMP, Attachment(12)) == (
        "nobody has signed it, and who names somebody there has to"
    )
    of_bob = all_of_us.signed("operator.bob", GOAL).signature
    assert signed.signature is not None
    assert of_bob is not None
    mixed = Signature(signed.signature.value, of_bob.certificate)
    assert "not what operator.bob has signed" in str(judge(GOAL, STAMP, Attachment(12, mixed)))
    garbage = Signature(signed.signature.value, b"garbage")
    assert judge(GOAL, STAMP, Attachment(12, garbage)) == (
        "what it is signed with is no certificate"
    )


def test_old_words_are_not_taken_in_and_a_stop_is_whatever_clocks_show(
    all_of_us: Certified,
) -> None:
    late = stamp_of(ticks_of_time(NOW_S - FRESH_S - 1.0), 7)
    assert "it was signed 3601 s ago, and 3600 s are" in str(
        all_of_us.authority.too_old(GOAL.keyexpr, late)
    )
    assert all_of_us.authority.too_old(GOAL.keyexpr, STAMP) is None
    stop = value_at(STOP, StopAddress("s1"), Stop(stop="s1", by="ana"))
    signed = all_of_us.signed("operator.ana", stop, late)
    assert all_of_us.authority.too_old(stop.keyexpr, late) is None
    assert all_of_us.authority.objection(stop, late, signed) is None
    restamped = stamp_of(ticks_of_time(NOW_S), 9)
    assert all_of_us.authority.objection(stop, restamped, signed) is None
    forged = all_of_us.signed("operator.bob", stop)
    assert "'ana'" in str(all_of_us.authority.objection(stop, STAMP, forged))


def test_whose_certificate_is_anothers_or_over_or_unknown_is_not_believed(
    all_of_us: Certified, tmp_path: Path
) -> None:
    others = Certified(tmp_path / "others")
    foreign = others.signed("operator.ana", GOAL)
    assert all_of_us.authority.objection(GOAL, STAMP, foreign) == (
        "the certificate of 'operator.ana' is not of this fleet's authority"
    )
    later_s = NOW_S + 366 * 86400.0
    judge = Authority(all_of_us.roots, now_s=lambda: later_s)
    signed = all_of_us.signed("operator.ana", GOAL)
    expired = "the certificate of operator.ana, who has signed it, has expired"
    assert judge.objection(GOAL, STAMP, signed) == expired
    early = Authority(all_of_us.roots, now_s=lambda: NOW_S - 3600.0)
    assert "is not valid yet" in str(early.objection(GOAL, STAMP, signed))
    # It is found out again each time, also of one that was valid when it was first seen.
    now_s = [NOW_S]
    same = Authority(all_of_us.roots, now_s=lambda: now_s[0])
    assert same.objection(GOAL, STAMP, signed) is None
    now_s[0] = later_s
    assert same.objection(GOAL, STAMP, signed) == expired
    revoked = Authority(all_of_us.roots, frozenset({"operator.bob"}), lambda: NOW_S)
    assert revoked.objection(GOAL, STAMP, signed) == (
        "the router does not know operator.ana, or no more"
    )


def test_one_who_is_certified_certifies_nobody(all_of_us: Certified) -> None:
    bob = all_of_us.office.files(Identity.parse("operator.bob"))
    folder = all_of_us.office.folder / "bobs"
    folder.mkdir()
    (folder / "ca.pem").write_bytes(bob.certificate.read_bytes())
    (folder / "ca.key").write_bytes(bob.key.read_bytes())
    bobs = Office(folder)
    bobs.issue(Identity.parse("operator.ana"), now=NOW)
    file = read_zenoh_file(bobs.files(Identity.parse("operator.ana")).settings)
    ana = of_client(file)
    assert ana is not None
    assert ana.signer is not None
    text = ana.signer.attachment(GOAL.keyexpr, text_of_stamp(STAMP), GOAL.data) or ""
    said = all_of_us.authority.objection(GOAL, STAMP, Attachment.read(text.encode()))
    assert said == "the certificate of 'operator.ana' is not of this fleet's authority"


@pytest.mark.parametrize(
    "key",
    [
        lambda: rsa.generate_private_key(65537, 2048),
        lambda: ec.generate_private_key(ec.SECP384R1()),
    ],
    ids=["rsa", "p-384"],
)
def test_a_key_of_another_infrastructure_signs(tmp_path: Path, key: Callable[[], OtherKey]) -> None:
    us = Certified(tmp_path)
    rekey(us.office, "operator.ana", key())
    assert us.objection("operator.ana", GOAL) is None
    assert us.objection("operator.ana", value_at(GOAL_SPEC, GoalAddress("g1"), BOB_WANTS)) == (
        "operator.ana has signed it, and it says that it is from 'bob', not ana"
    )
    signed, other = us.signed("operator.ana", GOAL), replace(GOAL, data=GOAL.data + b" ")
    assert str(us.authority.objection(other, STAMP, signed)).startswith("it is not what")
    # What one has signed is not believed with the certificate of another key.
    assert signed.signature is not None
    bobs = us.signed("operator.bob", GOAL).signature
    assert bobs is not None
    mixed = Attachment(12, Signature(signed.signature.value, bobs.certificate))
    assert str(us.authority.objection(GOAL, STAMP, mixed)).startswith("it is not what")


@pytest.mark.parametrize(
    "key",
    [lambda: rsa.generate_private_key(65537, 1024), ed25519.Ed25519PrivateKey.generate],
    ids=["short", "ed25519"],
)
def test_a_key_that_does_not_sign_is_a_sentence(
    tmp_path: Path, key: Callable[[], OtherKey]
) -> None:
    us = Certified(tmp_path)
    signed = us.signed("operator.ana", GOAL)
    rekey(us.office, "operator.ana", key())
    why = "it is neither of an elliptic curve, as `robotctl certs` makes them, nor RSA of 2048 bits"
    with pytest.raises(BadZenohConfig, match=f"the key .* of operator.ana cannot be used: {why}"):
        us.credentials("operator.ana")
    pem = us.office.files(Identity.parse("operator.ana")).certificate.read_bytes()
    certificate = x509.load_pem_x509_certificate(pem).public_bytes(Encoding.DER)
    assert signed.signature is not None
    odd = Attachment(12, Signature(signed.signature.value, certificate))
    said = str(us.authority.objection(GOAL, STAMP, odd))
    assert said.startswith(f"the key of operator.ana is of no use: {why}")


def test_what_nobody_can_read_is_from_nobody(all_of_us: Certified) -> None:
    odd = replace(GOAL, data=b'{"goal": "g1", "text": "x", "said_by": 5}')
    assert "not a Goal" in str(all_of_us.objection("operator.ana", odd))
    order = Encoded("home/robots/hsr/orders/p/t", b"{}", encoding_of(ORDER))
    assert all_of_us.objection("operator.ana", order) is None  # access control knows who it is
    text = all_of_us.signer("operator.ana").attachment(order.keyexpr, text_of_stamp(STAMP), b"{}")
    assert text is None
    assert all_of_us.authority.objection(order, STAMP, Attachment()) is None


def test_what_travels_beside_a_value_is_read_back_or_says_nothing(all_of_us: Certified) -> None:
    signed = all_of_us.signed("operator.ana", GOAL)
    for each in (
        Attachment(),
        Attachment(0),
        Attachment(5),
        signed,
        Attachment(None, signed.signature),
    ):
        assert Attachment.read((each.text() or "").encode()) == each
    whole = (signed.text() or "").encode()
    odd = (b"late", b"late x", b"late 1 2", b"1234/ab", b"\xff", b"signed", whole + b" x")
    for data in (*odd, b"late " + b"1" * 19, b"signed = =", b"late 1" + b" " * LONGEST):
        assert Attachment.read(data) == Attachment()


def test_a_router_believes_whom_its_access_control_names(tmp_path: Path) -> None:
    now = datetime.now(UTC)
    us = Certified(tmp_path, now)
    stamp = stamp_of(ticks_of_time(now.timestamp()), 7)
    signed = us.signed("operator.ana", GOAL, stamp)
    for known in (True, False):
        us.office.renew_access()
        authority = us.credentials("router").authority
        assert authority is not None
        told = authority.objection(GOAL, stamp, signed)
        assert told == (None if known else "the router does not know operator.ana, or no more")
        if known:
            us.office.revoke(Identity.parse("operator.ana"))


def test_why_something_is_refused_is_short_whatever_it_says(
    all_of_us: Certified, tmp_path: Path
) -> None:
    wanted = replace_by(ANA_WANTS, "a" * 200_000)
    goal = value_at(GOAL_SPEC, GoalAddress("g1"), wanted)
    with SqliteStore(tmp_path) as store:
        admission = Admission(store, now_s=lambda: NOW_S, authority=all_of_us.authority)
        write = Write(goal.keyexpr, STAMP, False, goal.encoding, goal.data)
        assert admission.judged(write, all_of_us.signed("operator.bob", goal)) is None
        refused = admission.refused(goal.keyexpr)
    assert refused is not None
    assert refused.why.startswith("operator.bob has signed it, and it says that it is from 'aaa")
    assert len(refused.why) < 1000
