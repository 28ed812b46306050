"""What somebody wants sooner or later than before goes on, and robots and plans go by that."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.planning_input import planning_input
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.history import GoalRecord, PlanRecord
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import bring, manipulator


def test_a_plan_whose_goal_becomes_more_urgent_gets_the_robot_first() -> None:
    model = FleetModel((manipulator(),), cups=3)
    for number in (1, 2, 3):
        model.plan(bring(number, "hallway"))
    (first,) = model.wanted()
    assert first.plan == "plan-1"
    last = bring(3, "hallway")
    revision = model.state.plans["plan-3"].plan.revision
    model.receive(events.GoalPut, goal=replace(last, priority=5, due_s=900.0, said_by="ana"))
    assert model.goal_state("g3") is GoalState.RUNNING
    entry = model.state.plans["plan-3"]
    assert (entry.plan.revision, entry.replan, entry.job) == (revision, None, None)
    while (order := model.wanted()[0]).plan == "plan-1":
        model.succeed(order)
    assert order.plan == "plan-3", "the one in between would have been next"
    assert (model.state.goals["g3"].due_s, model.state.goals["g3"].said_by) == (900.0, "ana")
    model.crash()
    model.finish()
    assert {goal.state for goal in model.goal_states.values()} == {GoalState.REACHED}


def test_the_next_plan_is_made_for_the_new_time() -> None:
    model = fleet()
    model.late = True
    goal = bring(1, "hallway")
    model.plan(goal)
    model.answer()
    model.receive(events.GoalPut, goal=replace(goal, due_s=70.0))
    entry = model.state.plans["plan-1"]
    assert entry.job is None
    model.learn("cup_1", "at", "living_room")
    job = model.state.plans["plan-1"].job
    assert job is not None
    (given,) = planning_input(model.state, job).goals
    assert given.due_s == 70.0


def test_what_the_sentence_adds_stays_and_its_parts_follow() -> None:
    model = fleet()
    text = "Bring cup 1 to the hallway within 5 minutes. Bring cup 2 to the hallway in an hour."
    goal = Goal(goal="g", text=text, said_s=model.time_s)
    model.receive(events.GoalPut, goal=goal)
    before = {name: model.state.goals[name] for name in ("g.1", "g.2")}
    assert before["g.1"].due_s is not None
    model.receive(events.GoalPut, goal=replace(goal, priority=3))
    after = {name: replace(goal, priority=3) for name, goal in before.items()}
    assert {name: model.state.goals[name] for name in after} == after
    assert model.goal_state("g") is GoalState.STANDING


def test_a_goal_that_is_over_is_kept_as_it_was_put() -> None:
    """Its key says it again when a planner starts: it must be told from a new wish."""
    model = fleet()
    goal = Goal(goal="g", text="Urgently bring cup 1 to the hallway.")
    model.plan(goal)
    assert model.state.goals["g"].priority > 0
    model.finish()
    over = [goal for r in model.past if isinstance(r, PlanRecord) for goal in r.goals]
    over += [record for record in model.past if isinstance(record, GoalRecord)]
    assert [record.spec for record in over] == [goal]
