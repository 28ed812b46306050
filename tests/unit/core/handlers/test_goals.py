"""Goals in the core: understood, read by a model, in stages, deleted."""

from __future__ import annotations

from fleet.core import events
from fleet.core.effects import Interpret
from fleet.core.state import Policy
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.requests import ReplanRequest
from keyexpr_schema.payloads.tasks import ReportState
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import at, carrier, manipulator


def test_sentences_wait_for_the_names_they_use() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.receive(events.GoalPut, goal=Goal(goal="g", text="bring the vase to the hallway"))
    assert model.goal_state("g") is GoalState.REJECTED
    assert "known are cup_1" in (model.goal_states["g"].reason or "")
    vase = events.ObjectPut(
        object=model.state.objects["cup_1"].__class__(object="vase", kind="vase", label="vase"),
        time_s=1.0,
        wall_time_s=1.0,
    )
    model.receive(events.ObjectPut, object=vase.object)
    assert model.goal_state("g") is GoalState.WAITING


def test_a_goal_in_steps_takes_one_after_the_other() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="kindly do the usual with cup one"))
    assert model.goal_state("g") is GoalState.READING
    model.plan(goals=("g",))
    assert "still being worked out" in model.replies["r0"].sentence
    assert any(isinstance(effect, Interpret) for effect in model.effects)
    stages = ((at("cup_1", "hallway"),), (at("cup_1", "living_room"),))
    model.receive(events.GoalInterpreted, goal="g", stages=stages)
    model.plan()
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert model.state.facts[FactKey(AT, "cup_1")].value == "living_room"
    places = [
        record.args["place"]
        for record in model.plans["plan-1"].records.values()
        if record.skill == "place"
    ]
    assert places == ["hallway", "living_room"]


def test_what_an_earlier_step_brought_somewhere_stays_there() -> None:
    model = FleetModel((manipulator(), manipulator("r2"), carrier()), cups=2)
    text = "Bring both cups to the living room, then send the locobot to the kitchen."
    model.plan(Goal(goal="g", text=text))
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert {str(c) for c in model.goal_states["g"].conditions} == {
        "at(locobot) = kitchen",
        "at(cup_1) = living_room",
        "at(cup_2) = living_room",
    }


def test_a_sentence_that_no_model_understands_is_refused() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="hum a tune"))
    model.receive(events.GoalInterpreted, goal="g", reason="it is no task for robots")
    assert model.goal_state("g") is GoalState.REJECTED
    assert "no task for robots" in (model.goal_states["g"].reason or "")


def read_by_model(model: FleetModel) -> list[str]:
    """Sentences that went to the language model."""
    return [e.given.text for e in model.effects if isinstance(e, Interpret)]


def test_a_sentence_that_has_changed_is_read_again_and_the_old_reading_counts_no_more() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    for text in ("hum a tune", "whistle a tune"):
        model.receive(events.GoalPut, goal=Goal(goal="g", text=text))
    assert read_by_model(model) == ["hum a tune", "whistle a tune"]
    stages = ((at("cup_1", "hallway"),),)
    model.receive(events.GoalInterpreted, goal="g", text="hum a tune", stages=stages)
    assert model.goal_state("g") is GoalState.READING
    reason = "it is no task for robots"
    model.receive(events.GoalInterpreted, goal="g", text="whistle a tune", reason=reason)
    assert model.goal_state("g") is GoalState.REJECTED


def test_a_reading_is_not_taken_for_a_sentence_that_the_grammar_has_read_since() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(interpreter=True))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="hum a tune"))
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring cup 1 to the hallway"))
    stages = ((at("cup_1", "living_room"),),)
    model.receive(events.GoalInterpreted, goal="g", text="hum a tune", stages=stages)
    assert [str(c) for c in model.goal_states["g"].conditions] == ["at(cup_1) = hallway"]
    model.receive(events.GoalDeleted, goal="g")
    model.receive(events.GoalPut, goal=Goal(goal="g", text="hum a tune"))
    assert read_by_model(model) == ["hum a tune", "hum a tune"]


def test_a_deleted_goal_leaves_the_plan() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.receive(events.GoalDeleted, goal="g2")
    model.finish()
    entry = model.plans["plan-1"]
    assert entry.state is PlanState.SUCCEEDED
    assert entry.plan.goals == ("g1",)
    assert "goals/g2/status" not in model.documents


def test_a_plan_for_a_goal_that_was_deleted_is_cancelled_and_says_why() -> None:
    model = fleet()
    model.plan(BOTH[0])
    orders = model.orders()
    model.receive(events.GoalDeleted, goal="g1")
    for order in orders:
        model.report(order, ReportState.CANCELLED)
    status = model.documents["plans/plan-1/status"]
    assert (status.state, status.reason) == (PlanState.CANCELLED, "goal g1 was deleted")


def test_a_goal_that_comes_up_joins_the_running_plan_when_asked() -> None:
    model = fleet()
    model.plan(BOTH[0])
    model.receive(events.GoalPut, goal=BOTH[1])
    model.receive(
        events.ReplanRequested,
        request=ReplanRequest(request="x", plan="plan-1", reason="more", goals=("g2",)),
    )
    assert model.plans["plan-1"].plan.goals == ("g1", "g2")
    model.finish()
    assert model.goal_state("g2") is GoalState.REACHED


def test_goals_are_planned_unasked_where_the_policy_says_so() -> None:
    model = fleet()
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=Policy(auto_plan=True))
    for goal in BOTH:
        model.receive(events.GoalPut, goal=goal)
    assert list(model.plans) == ["plan-1"]
    model.finish()
    assert [model.goal_state(g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2
