"""Answers of planning jobs for which the time, or a process, did not suffice."""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import DropJob, MakePlan
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.planning_input import PlanningInput
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import Control, ControlRequest, PlanRequest, ReplanRequest
from tests.support.fleet_model import BOTH, Answer, FleetModel
from tests.support.household import carrier, manipulator

WHY = "not planned within 60 s"


class Short(FleetModel):
    """A fleet whose planner has no time for `slow` goals, or, with `lost`, for any."""

    slow: tuple[str, ...] = ()
    lost = False

    def run(self, given: PlanningInput) -> Answer:
        if self.lost:
            at = {"time_s": given.time_s, "wall_time_s": given.wall_time_s}
            return events.PlanningFailed(job=given.job.job, reason=WHY, postponed=True, **at)
        goals = tuple(goal for goal in given.goals if goal.goal not in self.slow)
        answer = super().run(replace(given, goals=goals))
        postponed = {g.goal: WHY for g in given.goals if g.goal in self.slow}
        assert isinstance(answer, events.PlanningSucceeded)
        return replace(answer, postponed=postponed, not_in_time=tuple(postponed))


def short(**fields: Any) -> Short:
    model = Short((manipulator(), carrier()), 2)
    for name, value in fields.items():
        setattr(model, name, value)
    return model


def waits(model: FleetModel, goal: str) -> bool:
    status = model.goal_states[goal]
    return (status.state, status.plan, status.reason) == (GoalState.WAITING, None, WHY)


def test_a_goal_for_which_there_was_no_time_waits_and_the_others_are_carried_out() -> None:
    model = short(slow=("g2",))
    model.plan(*BOTH)
    assert waits(model, "g2")
    assert f"goal g2 is left out: {WHY}" in model.replies["r0"].sentence
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    model.slow = ()
    model.receive(events.PlanRequested, request=PlanRequest(request="again"))
    model.finish()
    assert model.goal_state("g2") is GoalState.REACHED


def test_a_goal_added_to_a_running_plan_may_have_to_wait_and_ends_nothing() -> None:
    model = short(slow=("g2",))
    model.plan(BOTH[0])
    model.receive(events.GoalPut, goal=BOTH[1])
    ask = ReplanRequest(request="q", plan="plan-1", goals=("g2",), reason="so")
    model.receive(events.ReplanRequested, request=ask)
    assert waits(model, "g2")
    assert model.plans["plan-1"].state is PlanState.RUNNING
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED


def test_a_running_plan_without_an_answer_ends_and_its_goals_wait() -> None:
    model = short()
    model.plan(*BOTH)
    model.lost = True
    model.fail(model.orders()[0])
    assert waits(model, "g1")
    assert waits(model, "g2")
    for order in model.orders():
        assert order.cancelled
        model.cancelled(order)
    model.lost = False
    model.receive(events.PlanRequested, request=PlanRequest(request="again"))
    model.finish()
    assert {model.goal_state("g1"), model.goal_state("g2")} == {GoalState.REACHED}


def test_a_job_that_nobody_waits_for_any_more_is_dropped() -> None:
    model = FleetModel((manipulator(), carrier()), 2, late=True)
    model.plan(*BOTH)
    (made,) = [effect for effect in model.effects if isinstance(effect, MakePlan)]
    cancel = ControlRequest(request="c", control=Control.CANCEL, plan="plan-1")
    model.receive(events.ControlRequested, request=cancel)
    assert DropJob(made.given.job.job) in model.effects
    model.answer()
    assert not [r for r in model.plans["plan-1"].records.values() if r.state in OUTSTANDING]
