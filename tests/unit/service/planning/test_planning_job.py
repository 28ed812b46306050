"""How often a planning job has plans checked: a plan's check travels with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from math import prod

import pytest

from fleet.core import events
from fleet.core.checker.well_formedness import PlanForm
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.symbolic.action_sequences import Subgoal, alternatives_for
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.requests import ReplanRequest
from tests.support.fleet_model import FleetModel, planned
from tests.support.household import bring, carrier, home, manipulator


def test_every_candidate_is_checked_once_and_the_best_once_more_and_once_allocated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    checks: Counter[str] = Counter()
    read = PlanForm.__init__

    def counted(
        form: PlanForm, plan: Plan, world: WorldModel, allocation: Mapping[str, str] | None
    ) -> None:
        checks["with actors" if allocation is None else "with robots"] += 1
        read(form, plan, world, allocation)

    monkeypatch.setattr(PlanForm, "__init__", counted)
    planned.cache_clear()  # another test may have planned for the same
    robots = manipulator(), carrier()
    model = FleetModel(robots, cups=2)
    goals = bring(1, "hallway"), bring(2, "living_room")
    model.plan(*goals)
    assert model.state.plans, model.state
    # The symbolic planner compares every pair of action sequences for two goals; then it tries the
    # order of its choice, and the allocator that of its own.
    pairs = prod(_alternatives(goal, home(robots, 2)) for goal in goals)
    assert pairs > 1
    assert checks == {"with actors": pairs, "with robots": 2}


def test_a_plan_comes_with_what_no_plan_for_its_goals_is_shorter_than() -> None:
    model = FleetModel((manipulator(), carrier()), cups=2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"))
    outcome = model.plans["plan-1"].outcome
    assert outcome.mission_bound_s is not None and outcome.predicted_makespan_s is not None
    # One hand takes both; each is at least taken and put, here or into the basket.
    assert 40.0 < outcome.mission_bound_s <= outcome.predicted_makespan_s
    # Of what a robot is in the midst of, nobody knows how much is left.
    model.start(model.orders()[0])
    model.receive(
        events.ReplanRequested, request=ReplanRequest(request="again", plan="plan-1", reason="x")
    )
    assert model.plans["plan-1"].plan.revision == 2
    assert model.plans["plan-1"].outcome.mission_bound_s is None


def _alternatives(goal: Goal, world: WorldModel) -> int:
    """How many different sequences the planner finds for a goal with one condition."""
    (condition,) = goal.conditions
    subgoal = Subgoal(goal.goal, condition)
    found = alternatives_for(subgoal, dict(world.facts), world, TimeBudget(60.0))
    assert isinstance(found, tuple)
    return len(found[0])
