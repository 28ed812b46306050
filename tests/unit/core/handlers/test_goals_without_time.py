"""Goals for which the time for planning did not suffice are planned beside the others, by and by.

Time is so many looks at the clock.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.planning_input import PlanningInput
from fleet.jobshop.time_budget import StepClock
from fleet.service.planning.planning_job import run_planning_job
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import PlanRequest
from tests.support.fleet_model import COMPOSITION, Answer, FleetModel
from tests.support.household import bring, carrier, manipulator

GOALS = tuple(bring(n, ("hallway", "living_room")[n % 2]) for n in range(1, 7))
FOR_SOME = 100.0
FOR_NONE = 10.0
NOT_IN_TIME = "not planned within 50 s"


class Hurried(FleetModel):
    """A fleet whose planning jobs have so many looks at the clock."""

    limit_s = FOR_SOME

    def run(self, given: PlanningInput) -> Answer:
        given = replace(given, limit_s=self.limit_s)
        return run_planning_job(given, COMPOSITION, StepClock(1.0))


def hurried(**policy: Any) -> Hurried:
    model = Hurried((manipulator(), manipulator("hsr_2"), carrier()), len(GOALS), late=True)
    model.state = replace(model.state, policy=replace(model.state.policy, **policy))
    for goal in GOALS:
        model.receive(events.GoalPut, goal=goal)
    return model


def planned(model: FleetModel) -> list[set[str]]:
    """The goals of each revision of the plan, as they come, until nothing more is planned."""
    found = []
    while model.answers:
        model.answer()
        found.append(set(model.plans["p"].plan.goals))
    return found


@pytest.mark.parametrize("strategy", ["big-dag", "per-goal", "monolithic"])
def test_one_revision_after_the_other_takes_up_as_many_as_there_is_time_for(strategy: str) -> None:
    model = hurried()
    ask = PlanRequest(request="r", plan="p", strategy=strategy)
    model.receive(events.PlanRequested, request=ask)
    model.answer()
    first = set(model.plans["p"].plan.goals)
    late = {goal.goal for goal in GOALS} - first
    assert first
    assert late
    waiting = {g: model.goal_states[g].reason for g in late}
    assert waiting == dict.fromkeys(late, NOT_IN_TIME)
    assert model.orders(), "the others are carried out meanwhile"
    why = model.plans["p"].replan
    assert why is not None
    assert why.sentence.endswith(" are still to be planned")
    revisions = [first, *planned(model)]
    assert all(before < after for before, after in pairwise(revisions))
    assert revisions[-1] == {goal.goal for goal in GOALS}
    model.late = False
    model.finish()
    assert {model.goal_state(goal.goal) for goal in GOALS} == {GoalState.REACHED}


def test_a_plan_that_is_not_started_yet_takes_them_up_as_well() -> None:
    model = hurried()
    ask = PlanRequest(request="r", plan="p", start=False)
    model.receive(events.PlanRequested, request=ask)
    assert planned(model)[-1] == {goal.goal for goal in GOALS}
    assert model.plans["p"].state is PlanState.READY


def test_nothing_is_planned_beside_what_somebody_is_to_approve() -> None:
    model = hurried(approval=True)
    model.receive(events.PlanRequested, request=PlanRequest(request="r", plan="p"))
    assert len(planned(model)) == 1
    assert model.plans["p"].state is PlanState.PROPOSED


def test_what_no_time_suffices_for_is_not_tried_for_ever() -> None:
    model = hurried()
    model.receive(events.PlanRequested, request=PlanRequest(request="r", plan="p"))
    model.limit_s = FOR_NONE
    first, *more = planned(model)
    assert more == [first], "once more, in vain"
    late = {goal.goal for goal in GOALS} - first
    assert {model.goal_state(goal) for goal in late} == {GoalState.WAITING}
    model.limit_s = FOR_SOME
    model.receive(events.PlanRequested, request=PlanRequest(request="again", plan="q"))
    model.answer()
    assert late & set(model.plans["q"].plan.goals), "somebody may ask for them"
