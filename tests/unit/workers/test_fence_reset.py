"""What a robot was made to refuse for good, a person has it forget; not while its worker runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.payloads.system import LARGEST_EPOCH
from keyexpr_schema.payloads.tasks import Order, ReportState
from tests.support.robotctl import Robotctl
from workers.errors import JournalBusy, JournalUnreadable
from workers.orders.fence_reset import fences, forget_attempt
from workers.orders.fencing import Accept, Refuse, Repeat, decide, malformed
from workers.orders.journal import Journal, Retention
from workers.orders.outbox import make_report


def order(epoch: int, attempt: int = 1, **more: Any) -> Order:
    return Order(
        robot="hsr",
        plan="p",
        revision=more.pop("revision", 1),
        task=more.pop("task", f"t{epoch}"),
        attempt=attempt,
        epoch=epoch,
        planner="lineage",
        skill="navigate",
        args={"robot": "hsr", "to": "kitchen"},
        deadline_s=60.0,
        **more,
    )


def carried_out(journal: Journal, one: Order) -> None:
    journal.queued(one)
    journal.started(one, make_report(one, "r1", ReportState.STARTED))
    journal.ended(one, make_report(one, "r1", ReportState.SUCCEEDED))


def test_an_epoch_that_no_planner_counts_to_raises_no_fence() -> None:
    assert malformed(order(LARGEST_EPOCH)) is None
    for epoch in (LARGEST_EPOCH + 1, 2**62):
        assert "larger than any that a planner counts to" in str(malformed(order(epoch)))


def test_what_was_ordered_with_a_forged_epoch_is_forgotten(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    real, forged = order(3, serial=7), order(LARGEST_EPOCH, revision=10**9, serial=10**12)
    with Journal(path) as journal:
        carried_out(journal, real)
        carried_out(journal, forged)
        refused = decide(journal.ledger, order(4, task="next", serial=8))
        assert isinstance(refused, Refuse)
        assert "robotctl fence ROBOT --reset-below EPOCH" in refused.reason
        with pytest.raises(JournalBusy, match="another worker runs for this robot"):
            fences(path, 1000)
    assert fences(path).epoch == LARGEST_EPOCH
    assert fences(path).attempts == (3, LARGEST_EPOCH)
    left = fences(path, 1000)
    assert (left.epoch, left.attempts, left.forgotten) == (3, (3,), 1)
    with Journal(path) as journal:
        assert decide(journal.ledger, order(4, task="next", serial=8)) == Accept()
        # What the robot has done is still not done twice, and an older planner is refused.
        assert isinstance(decide(journal.ledger, real), Repeat)
        assert isinstance(decide(journal.ledger, order(2, task="old", serial=9)), Refuse)


def test_forgotten_serials_fence_up_to_the_newest_that_is_left(tmp_path: Path) -> None:
    path = tmp_path / "hsr.journal"
    with Journal(path, Retention(count=0)) as journal:
        forged = order(LARGEST_EPOCH, serial=10**12)
        carried_out(journal, forged)
        while (word := journal.unsent()) is not None:
            journal.sent(word.number)
        journal.forget(lambda _: False)
        assert journal.ledger.forgotten == {"lineage": 10**12}
    with Journal(path) as journal:
        # Its serial is refused; it was taken on before the forged one came.
        carried_out(journal, order(3, serial=7))
    assert fences(path, 1000).epoch == 3
    with Journal(path) as journal:
        assert journal.ledger.forgotten == {"lineage": 7}
        assert decide(journal.ledger, order(4, task="next", serial=8)) == Accept()


def test_a_serial_of_which_no_attempt_is_left_is_lifted_as_the_refusal_says(
    tmp_path: Path,
) -> None:
    robotctl = Robotctl("tcp/127.0.0.1:1", tmp_path)
    path = tmp_path / "hsr.journal"
    data = ("fence", "hsr", "--data", str(tmp_path))
    known = order(3, task="known", serial=8)
    with Journal(path, Retention(count=0)) as journal:
        carried_out(journal, order(3, task="forged", serial=2**63 - 1))
        while (word := journal.unsent()) is not None:
            journal.sent(word.number)
        journal.forget(lambda _: False)
    with Journal(path) as journal:
        refused = decide(journal.ledger, known)
        assert isinstance(refused, Refuse)
        assert "--reset-serial lineage/7`" in refused.reason
    assert f"; of lineage above serial {2**63 - 1}; epochs" in robotctl(*data).out
    wrong = {
        "lineage": "write PLANNER/SERIAL",
        "other/7": f"refuse what is above other/7; up to where it does: lineage/{2**63 - 1}",
    }
    for name, why in wrong.items():
        said = robotctl(*data, "--reset-serial", name)
        assert said.code != 0
        assert why in said.err
    done = robotctl(*data, "--reset-serial", "lineage/7")
    assert done.out == "hsr takes orders above lineage/7 again\n"
    with Journal(path) as journal:
        assert decide(journal.ledger, known) == Accept()
        late = decide(journal.ledger, order(3, task="late", serial=7))
        assert isinstance(late, Refuse)
        assert "--reset-serial" not in late.reason  # so many are forgotten on any day


def test_one_attempt_that_locks_a_task_and_its_plan_is_forgotten_and_nothing_else(
    tmp_path: Path,
) -> None:
    path = tmp_path / "hsr.journal"
    real = order(3, task="t1", serial=7)
    forged = order(3, attempt=10**6, task="t1", revision=10**9, serial=8)
    later = (order(3, attempt=2, task="t1", serial=9), order(3, task="t2", serial=9))
    with Journal(path) as journal:
        carried_out(journal, real)
        carried_out(journal, forged)
        for one, why in zip(later, ("revision", "revision"), strict=True):
            refused = decide(journal.ledger, one)
            assert isinstance(refused, Refuse)
            assert why in refused.reason
            assert "--forget PLAN/TASK/ATTEMPT" in refused.reason
        again = decide(journal.ledger, order(3, attempt=2, task="t1", revision=10**9, serial=9))
        assert isinstance(again, Refuse)
        assert "older than attempt 1000000" in again.reason
        assert "--forget PLAN/TASK/ATTEMPT" in again.reason
    assert forget_attempt(path, "p", "t1", 5).forgotten == 0
    left = forget_attempt(path, "p", "t1", 10**6)
    assert (left.epoch, left.forgotten, left.names) == (3, 1, (("p/t1/1", 1),))
    with Journal(path) as journal:
        for one in later:
            assert decide(journal.ledger, one) == Accept()
        assert isinstance(decide(journal.ledger, real), Repeat)
        assert isinstance(decide(journal.ledger, order(2, task="t3", serial=10)), Refuse)


def test_a_person_is_told(tmp_path: Path) -> None:
    robotctl = Robotctl("tcp/127.0.0.1:1", tmp_path)
    with Journal(tmp_path / "hsr.journal") as journal:
        carried_out(journal, order(2**40))
        busy = robotctl("fence", "hsr", "--data", str(tmp_path), "--reset-below", "9")
        assert busy.code == 1
        assert busy.err.startswith("Error: ")
        assert "stop that one first" in busy.err
    done = robotctl("fence", "hsr", "--data", str(tmp_path), "--reset-below", "9")
    assert done.out == "hsr has forgotten 1 attempts, and takes orders from epoch 0 on\n"
    with Journal(tmp_path / "hsr.journal") as journal:
        carried_out(journal, order(1, task="t1", attempt=10**6))
    wrong = {
        "p/t1/2": "knows no attempt p/t1/2; those that it knows: p/t1/1000000",
        "p": "write",
        f"p/t1/{10**19}": "write",  # no attempt is that high, nor a number in a journal
    }
    for name, why in wrong.items():
        refused = robotctl("fence", "hsr", "--data", str(tmp_path), "--forget", name)
        assert refused.code != 0
        assert why in refused.err
    done = robotctl("fence", "hsr", "--data", str(tmp_path), "--forget", "p/t1/1000000")
    assert done.out == "hsr has forgotten attempt p/t1/1000000\n"


def test_where_there_is_no_journal_nothing_is_made(tmp_path: Path) -> None:
    with pytest.raises(JournalUnreadable, match="there is no journal in"):
        fences(tmp_path / "hsr.journal")
    assert list(tmp_path.iterdir()) == []
