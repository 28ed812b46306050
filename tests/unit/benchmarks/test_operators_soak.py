"""How the soak among operators judges what it sees: from outside, and against what really is so."""

from __future__ import annotations

import pytest

from benchmarks.scale.operators.growth import growth_percent
from benchmarks.scale.operators.witness import Witness
from keyexpr_schema.ids import Id
from keyexpr_schema.keyspace import ORDER, REPORT, ROBOT_SPEC, SIM_SENSES, SIM_TRUTH
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.robots import RobotAddress, RobotSpec
from keyexpr_schema.payloads.simulation import SimRobotAddress, Truth, TruthAddress
from keyexpr_schema.payloads.tasks import Order, OrderAddress, Report, ReportAddress, ReportState
from keyexpr_schema.transport.selection import Change
from tests.support.household import manipulator


def report(attempt: int, state: ReportState, reason: str | None = None) -> Change:  # type: ignore[type-arg]
    told = Report(
        robot="hsr", plan="p", revision=1, task="t1", attempt=attempt, epoch=1,
        incarnation="i", state=state, reason=reason,
    )  # fmt: skip
    return Change(REPORT, ReportAddress.of(told), told, "")


def truth(place: Id | None, held_by: Id | None = None) -> Change:  # type: ignore[type-arg]
    told = Truth(
        object="cup_1", kind="cup", time_s=1.0, point_m=(0.0, 0.0, 0.0), place=place,
        support=None, held_by=held_by, settled=True,
    )  # fmt: skip
    return Change(SIM_TRUTH, TruthAddress("cup_1"), told, "")


def senses(charge: float) -> Change:  # type: ignore[type-arg]
    told = Senses(
        robot="hsr", time_s=1.0, pose_m_rad=(0.0, 0.0, 0.0), place="kitchen", moving=False,
        charge=charge,
    )  # fmt: skip
    return Change(SIM_SENSES, SimRobotAddress("hsr"), told, "")


def test_a_task_that_two_attempts_have_done_was_done_twice() -> None:
    witness = Witness()
    for attempt, state in ((1, ReportState.INTERRUPTED), (2, ReportState.SUCCEEDED)):
        witness.see(report(attempt, state))
        witness.see(report(attempt, state))
    assert witness.twice == []
    witness.see(report(3, ReportState.SUCCEEDED))
    assert witness.twice == [("p", "t1")]


def test_a_reason_is_true_if_a_robot_has_said_so_or_the_thing_was_forgotten() -> None:
    witness = Witness()
    given_up = "given up after 6 failed tasks; the last: t1 (pick) failed: it slipped"
    assert not witness.is_true(given_up, set())
    witness.see(report(1, ReportState.FAILED, "it slipped"))
    assert witness.is_true(given_up, set())
    unknown = "no sequence of skills leads to at(cup_1) = kitchen: nobody knows of cup_1"
    assert witness.is_true(unknown, {"cup_1"}) and not witness.is_true(unknown, {"cup_2"})
    assert not witness.is_true("the moon is full", {"cup_1"})


def test_things_have_been_where_they_were_put_down_or_driven_and_not_where_they_were_held() -> None:
    witness = Witness()
    for each in (truth("kitchen"), truth("hallway", held_by="hsr"), truth("study")):
        witness.see(each)
    assert witness.been["cup_1"] == {"kitchen", "study"}
    witness.look_anew()
    assert witness.been["cup_1"] == {"study"}


def test_who_is_stranded_is_said() -> None:
    witness, running = Witness(), {"p": PlanState.RUNNING}
    spec: RobotSpec = manipulator()
    witness.see(Change(ROBOT_SPEC, RobotAddress("hsr"), spec, ""))
    witness.see(senses(50.0))
    witness.see(truth("kitchen", held_by="hsr"))
    assert witness.stranded(running, {"cup_1"}) == []
    assert witness.stranded(running, set()) == ["hsr has cup_1 in its hand"]
    order = Order(
        robot="hsr", plan="p", revision=1, task="t1", attempt=1, epoch=1, skill="pick", args={},
        deadline_s=9.0,
    )  # fmt: skip
    witness.see(Change(ORDER, OrderAddress.of(order), order, ""))
    assert witness.stranded(running, {"cup_1"}) == ["hsr has an order of p/t1"]
    assert witness.stranded({"p": PlanState.CANCELLED}, {"cup_1"}) == []
    witness.see(senses(0.0))
    witness.see(Change(ROBOT_SPEC, RobotAddress("hsr"), None, ""))
    assert witness.holding() == ["hsr is empty", "hsr is not registered"]
    assert witness.emptied == ["hsr"]


@pytest.mark.parametrize(
    ("values", "percent"),
    [([5.0] * 100, 0.0), ([float(n) for n in range(50)] + [50.0] * 50, 0.0),
     ([100.0 + n for n in range(100)], 100 / 1.745), ([1.0], None)],
    ids=["flat", "until a bound", "growing", "too few"],
)  # fmt: skip
def test_growth_is_that_of_the_second_half(values: list[float], percent: float | None) -> None:
    assert growth_percent(list(enumerate(values))) == pytest.approx(percent, abs=0.3)
