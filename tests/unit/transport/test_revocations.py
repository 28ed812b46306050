"""What is signed with a revoked certificate is taken in by nobody who has heard of that."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from cli.certificates.authority import Authority as Office
from cli.certificates.identity import Identity
from cli.certificates.revocation_list import read_lists
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import BadZenohConfig
from keyexpr_schema.keyspace import GOAL_SPEC, REVOCATIONS, STORE_REPLACE
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.system import AuthorityAddress, Revocations, StoreAskerAddress
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.credentials import of_client
from keyexpr_schema.transport.revocations import BadList, shown
from keyexpr_schema.transport.samples import Encoded
from keyexpr_schema.transport.signatures import Authority
from keyexpr_schema.transport.stamps import text_of_stamp
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.zenoh_file import read_zenoh_file
from tests.support.certified import GOAL, NOW, NOW_S, STAMP, Certified, value_at

ANA, BOB = Identity.parse("operator.ana"), Identity.parse("operator.bob")
REVOKED = "the certificate of operator.ana, who has signed it, is revoked"


def revoked(office: Office, who: Identity = ANA, minutes: float = 1.0) -> Encoded:
    """The list that says so, as it stands on its key."""
    office.revoke(who, NOW + timedelta(minutes=minutes))
    (found,) = read_lists(office.revocations)
    return value_at(REVOCATIONS, *shown(found))


def judge(authority: Authority, list_: Encoded) -> str | None:
    return authority.objection(list_, STAMP, Attachment())


def test_a_certificate_is_revoked_and_another_one_of_the_same_name_is_not(tmp_path: Path) -> None:
    us = Certified(tmp_path)
    signed = us.signed("operator.ana", GOAL)
    assert us.authority.objection(GOAL, STAMP, signed) is None
    assert judge(us.authority, revoked(us.office)) is None
    assert us.authority.objection(GOAL, STAMP, signed) == REVOKED
    us.office.issue(ANA, now=NOW)
    assert us.objection("operator.ana", GOAL) is None
    assert us.authority.objection(GOAL, STAMP, signed) == REVOKED
    # One that was replaced is believed until somebody says that it is not to be.
    second = us.signed("operator.ana", GOAL)
    us.office.issue(ANA, now=NOW)
    assert judge(us.authority, revoked(us.office, BOB, 2.0)) is None
    assert us.authority.objection(GOAL, STAMP, second) is None
    assert judge(us.authority, revoked(us.office, ANA, 3.0)) is None
    assert us.authority.objection(GOAL, STAMP, second) == REVOKED


def test_only_the_authoritys_latest_list_is_taken_in_and_none_is_deleted(tmp_path: Path) -> None:
    us, others = Certified(tmp_path / "ours"), Certified(tmp_path / "others")
    signed, at = us.signed("operator.ana", GOAL), f"home/{REVOCATIONS.pattern()}"
    by_bob = us.deletes("operator.bob", at)
    before = revoked(us.office)
    # Two within a moment, or with a clock that was set back, are in order all the same.
    after = revoked(us.office, BOB, -60.0)
    assert judge(us.authority, after) is None
    assert judge(us.authority, after) is None
    assert judge(us.authority, before) == "there is a later list of revoked certificates"
    assert us.authority.objection(GOAL, STAMP, signed) == REVOKED
    foreign = revoked(others.office)
    assert judge(us.authority, foreign) == "it is not signed by this fleet's authority"
    (list_,) = read_lists(others.office.revocations)
    with pytest.raises(BadList):
        us.authority.revoked.learn(list_)
    odd = value_at(REVOCATIONS, AuthorityAddress("x"), Revocations(crl="eA=="))
    assert "it is no list of revoked certificates" in str(judge(us.authority, odd))
    elsewhere = Encoded("home/certificates/revoked/x", after.data, after.encoding)
    assert "of another authority than its key says" in str(judge(us.authority, elsewhere))
    nothing = Encoded(after.keyexpr, b"5", after.encoding)
    assert "not a Revocations" in str(judge(us.authority, nothing))
    deleted = us.authority.judge(after, STAMP, by_bob, deleted=True)
    assert "a list is not deleted" in str(deleted.objection)


def test_a_store_that_is_started_again_knows_and_believes_no_asker(tmp_path: Path) -> None:
    us = Certified(tmp_path / "certs")
    signer, said = us.signer("operator.ana"), us.signed("operator.ana", GOAL)
    asks = Encoded(f"home/{STORE_REPLACE.build(StoreAskerAddress('operator.ana'))}", b"{}", "")
    signed = signer.attachment(asks.keyexpr, text_of_stamp(0), asks.data) or ""
    beside = Attachment.read(signed.encode())
    goal = value_at(GOAL_SPEC, GoalAddress("g1"), Goal(goal="g1", text="x", said_by="ana"))

    def asked(admission: Admission, asker: str, attachment: Attachment) -> str | None:
        return admission.objection_to_asker(asker, asks, attachment, goal)

    with SqliteStore(tmp_path / "store") as store:
        admission = Admission(store, now_s=lambda: NOW_S, authority=us.authority)
        assert asked(admission, "operator.ana", beside) is None
        assert "nobody has signed it" in str(asked(admission, "operator.ana", Attachment()))
        assert asked(admission, "operator.bob", beside) == (
            "operator.ana has signed what operator.bob asks"
        )
        list_ = revoked(us.office)
        write = Write(list_.keyexpr, STAMP, False, list_.encoding, list_.data)
        judged = admission.judged(write, Attachment())
        assert judged is not None
        store.apply(admission.admitted([judged]))
        assert asked(admission, "operator.ana", beside) == REVOKED
        gone = Write(list_.keyexpr, STAMP + 1, True, "", b"")
        assert admission.judged(gone, us.deletes("operator.bob", list_.keyexpr)) is None
        # Nor does the store write one for somebody that it would not take in.
        bob = us.signer("operator.bob").attachment(asks.keyexpr, text_of_stamp(0), asks.data) or ""
        odd = value_at(REVOCATIONS, AuthorityAddress("x"), Revocations(crl="eA=="))
        by_bob = Attachment.read(bob.encode())
        assert "is no list" in str(admission.objection_to_asker("operator.bob", asks, by_bob, odd))
    again = Authority(us.roots, now_s=lambda: NOW_S)
    with SqliteStore(tmp_path / "store") as store:
        Admission(store, now_s=lambda: NOW_S, authority=again)
    assert again.objection(GOAL, STAMP, said) == REVOKED


def test_a_list_beside_the_authoritys_certificate_is_known_from_the_start(tmp_path: Path) -> None:
    us = Certified(tmp_path)
    signed = us.signed("operator.ana", GOAL)
    revoked(us.office)
    settings = us.office.files(BOB).settings
    authority = us.credentials("operator.bob").authority
    assert authority is not None
    assert REVOKED in str(authority.objection(GOAL, STAMP, signed))
    us.office.revocations.write_text("nothing")
    with pytest.raises(
        BadZenohConfig, match=r"the list of revoked certificates .*ca\.crl cannot be"
    ):
        of_client(read_zenoh_file(settings))
