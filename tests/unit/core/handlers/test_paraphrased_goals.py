"""Goals whose sentences a language model has said in other words: read, confirmed, kept."""

from __future__ import annotations

from datetime import datetime

import pytest

from fleet.core import events
from fleet.core.effects import Interpret
from fleet.core.planning_input import InterpretationInput
from fleet.core.state import Policy
from fleet.language import Confirm, read
from fleet.language.methods.model import CompoundTask, Method
from fleet.language.words.own_words import OwnWords
from fleet.service.planning.messages import HEADER, JOB, frame
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.world import Object
from tests.support.fleet_model import FleetModel
from tests.support.household import at, carrier, manipulator

ODD = "kindly do the usual with cup one"
PLAIN = "Bring cup 1 to the hallway."
MEANING = "at(cup_1) = hallway"


def model_with(
    confirm: Confirm = Confirm.ALWAYS, cups: int = 2, text: str = ODD, logic: int | None = None
) -> FleetModel:
    """A fleet with a language model, which is asked about a goal."""
    robots = (manipulator(), carrier())
    model = FleetModel(robots, cups) if logic is None else FleetModel(robots, cups, logic=logic)
    start(model, confirm, logic)
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text))
    return model


def start(model: FleetModel, confirm: Confirm, logic: int | None = None) -> None:
    policy = Policy(interpreter=True, confirm=confirm)
    given = {} if logic is None else {"logic": logic}
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=policy, **given)


def says(model: FleetModel, paraphrase: str, text: str = ODD) -> None:
    model.receive(events.GoalInterpreted, goal="g", text=text, paraphrase=paraphrase)


def means(model: FleetModel, meant: str, text: str = ODD) -> None:
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text, meant=meant))


def asked(model: FleetModel) -> list[Interpret]:
    return [effect for effect in model.effects if isinstance(effect, Interpret)]


def test_nothing_is_done_before_somebody_says_that_it_is_meant() -> None:
    model = model_with()
    assert model.goal_state("g") is GoalState.READING
    (effect,) = asked(model)
    assert effect.given.text == ODD
    assert "'the usual' is not a known object" in effect.given.refusal
    says(model, PLAIN)
    status = model.goal_states["g"]
    assert (status.state, status.candidates) == (GoalState.REJECTED, (MEANING,))
    assert (status.paraphrase, status.conditions) == (PLAIN, ())
    assert "robotctl goal answer g yes" in (status.reason or "")
    model.plan(goals=("g",))
    assert "plan-1" not in model.plans
    means(model, MEANING)
    assert model.goal_state("g") is GoalState.WAITING
    assert model.goal_states["g"].understood == "cup 1 is in the hallway"
    assert len(asked(model)) == 1
    model.plan(goals=("g",))
    model.finish()
    assert model.goal_state("g") is GoalState.REACHED
    assert model.state.facts[FactKey(AT, "cup_1")].value == "hallway"


def test_what_a_language_model_needs_goes_to_its_process_and_back() -> None:
    words = OwnWords(lists={"POLITE": ("mon ami",)})
    model = FleetModel((manipulator(), carrier()), 2)
    method = Method(do=(("find cup 1",),))
    policy = Policy(
        interpreter=True,
        words=(words,),
        tasks=(CompoundTask(name="tea", says=("make tea",), methods=(method,)),),
    )
    model.receive(events.PlannerStarted, epoch=2, incarnation="x", policy=policy)
    said_at = "2026-05-01T14:00:00+02:00"
    model.receive(events.GoalPut, goal=Goal(goal="g", text=ODD, said_at=said_at))
    (effect,) = asked(model)
    given = JOB.decode(frame(effect.given)[HEADER.size :])
    assert given == effect.given
    assert isinstance(given, InterpretationInput)
    assert given.now == datetime.fromisoformat(said_at)
    there = given.vocabulary()
    assert read("Bring cup 1 to the hallway, mon ami, at 3 pm.", there, given.now)
    assert read("Make tea.", there)


def test_what_is_said_to_be_meant_must_be_what_was_offered() -> None:
    model = model_with()
    says(model, PLAIN)
    means(model, "at(cup_2) = hallway")
    assert model.goal_states["g"].candidates == (MEANING,)
    assert model.goal_state("g") is GoalState.REJECTED
    assert len(asked(model)) == 1


def test_other_words_of_a_person_are_read_anew() -> None:
    model = model_with()
    says(model, PLAIN)
    means(model, MEANING, text="hum a tune")
    assert model.goal_state("g") is GoalState.READING
    assert [effect.given.text for effect in asked(model)] == [ODD, "hum a tune"]


def test_a_paraphrase_is_read_by_the_grammar_and_by_nothing_else() -> None:
    model = model_with(Confirm.NEVER)
    says(model, "rm -rf / and zorgle cup 1")
    status = model.goal_states["g"]
    assert (status.state, status.conditions) == (GoalState.REJECTED, ())
    assert "a language model says" in (status.reason or "")
    assert status.refusal in (status.reason or "")


def test_a_paraphrase_that_can_mean_several_things_is_asked_about_whatever_is_confirmed() -> None:
    model = model_with(Confirm.NEVER)
    says(model, "Bring the cup to the hallway.")
    status = model.goal_states["g"]
    assert set(status.candidates) == {MEANING, "at(cup_2) = hallway"}
    means(model, "at(cup_2) = hallway")
    assert model.goal_states["g"].conditions == (at("cup_2", "hallway"),)
    assert model.goal_state("g") is GoalState.WAITING


def test_facts_that_a_model_tells_are_not_believed_before_they_are_confirmed() -> None:
    model = model_with()
    says(model, "Cup 2 is in the living room. Bring cup 1 to the hallway.")
    assert model.state.facts[FactKey(AT, "cup_2")].value == "kitchen"
    means(model, model.goal_states["g"].candidates[0])
    assert model.state.facts[FactKey(AT, "cup_2")].value == "living_room"


@pytest.mark.parametrize(
    ("paraphrase", "text", "coarse"),
    [
        (PLAIN, "cup one wants to be where the hallway is", False),
        (PLAIN, "the usual with the cups in the hallway, hombre", False),
        (PLAIN, "kindly do the usual with cup one", True),  # names no place
        (PLAIN, "kindly do the usual in the hallway", True),  # names nothing that is moved
        (
            PLAIN,
            "the hsr does the usual with the cups in the hallway, hombre",
            True,
        ),  # the hsr is lost
        ("The hsr shall bring cup 1 to the hallway.", "the cups and the hallway, hombre", True),
        (PLAIN, "nope, not the usual with the cups in the hallway", True),
        ("Bring all cups to the hallway.", "cups to hallway, por favor", True),  # many
        ("Cup 2 is in the kitchen. Bring cup 1 to the hallway.", "cup hallway hombre", True),
    ],
)
def test_coarse_asks_about_what_could_do_harm(paraphrase: str, text: str, coarse: bool) -> None:
    model = model_with(Confirm.COARSE, cups=4, text=text)
    assert model.goal_state("g") is GoalState.READING
    says(model, paraphrase, text)
    assert (model.goal_state("g") is GoalState.REJECTED) == coarse
    assert bool(model.goal_states["g"].candidates) == coarse


def test_never_takes_it_at_once_and_says_so() -> None:
    model = model_with(Confirm.NEVER)
    says(model, PLAIN)
    status = model.goal_states["g"]
    assert (status.state, status.understood) == (GoalState.WAITING, "cup 1 is in the hallway")
    assert (status.paraphrase, status.reason) == (PLAIN, None)


@pytest.mark.parametrize(("text", "again"), [("hum a tune", 0), ("bring the vase to me", 1)])
def test_a_model_that_knows_no_other_words_is_asked_again_when_the_grammar_says_something_else(
    text: str, again: int
) -> None:
    model = model_with(text=text)
    model.receive(events.GoalInterpreted, goal="g", reason="it is no task for robots")
    status = model.goal_states["g"]
    assert status.state is GoalState.REJECTED
    assert "no task for robots" in (status.reason or "")
    model.receive(events.ObjectPut, object=Object(object="vasa", kind="vasa", label="vasa"))
    assert len(asked(model)) == 1 + again
    assert (model.goal_states["g"].refusal == status.refusal) == (not again)


def test_a_goal_that_is_put_once_more_goes_once_more_to_a_model_that_was_away() -> None:
    model = model_with()
    model.receive(events.GoalInterpreted, goal="g", text=ODD, reason="it gave no answer")
    assert model.goal_state("g") is GoalState.REJECTED
    model.receive(events.GoalPut, goal=Goal(goal="g", text=ODD, priority=1))
    assert model.goal_state("g") is GoalState.READING
    says(model, PLAIN)
    model.receive(events.GoalPut, goal=Goal(goal="g", text=ODD, priority=2))
    assert model.goal_states["g"].candidates == (MEANING,)
    assert len(asked(model)) == 2


def test_a_planner_without_its_journal_asks_anew_and_takes_what_was_confirmed() -> None:
    """What an earlier one has left may be of other words."""
    old = model_with()
    says(old, PLAIN)
    means(old, MEANING)
    model = FleetModel((manipulator(), carrier()), 2)
    start(model, Confirm.ALWAYS)
    model.receive(events.PriorStateLoaded, goals=(old.goal_states["g"],))
    means(model, MEANING)
    assert len(asked(model)) == 1
    says(model, PLAIN)
    assert model.goal_state("g") is GoalState.WAITING


def test_names_that_come_later_let_the_grammar_read_what_was_said() -> None:
    model = model_with(text="bring the vase to the hallway")
    says(model, PLAIN, text="bring the vase to the hallway")
    assert model.goal_states["g"].candidates == (MEANING,)
    model.receive(events.ObjectPut, object=Object(object="vase", kind="vase", label="vase"))
    status = model.goal_states["g"]
    assert (status.state, status.conditions) == (GoalState.WAITING, (at("vase", "hallway"),))
    assert (status.paraphrase, status.candidates) == (None, ())


def test_what_was_confirmed_stays_as_it_was_when_the_sentence_can_be_read() -> None:
    model = model_with(text="bring the vase to the hallway")
    says(model, PLAIN, text="bring the vase to the hallway")
    means(model, MEANING, text="bring the vase to the hallway")
    model.receive(events.ObjectPut, object=Object(object="vase", kind="vase", label="vase"))
    assert model.goal_states["g"].conditions == (at("cup_1", "hallway"),)


@pytest.mark.parametrize("text", ["bring the cup to the hallway", "is cup 1 in the kitchen?"])
def test_a_model_is_asked_only_about_what_the_grammar_refuses(text: str) -> None:
    assert model_with(text=text).goal_state("g") is GoalState.REJECTED
    assert asked(model_with(text=text)) == []


def test_journals_from_before_are_handled_as_they_were() -> None:
    text = "bring the cup to the hallway"
    model = model_with(text=text, logic=4)
    assert model.goal_state("g") is GoalState.READING
    stages = ((at("cup_1", "hallway"),),)
    model.receive(events.GoalInterpreted, goal="g", text=text, stages=stages)
    assert model.goal_state("g") is GoalState.WAITING
    assert model.goal_states["g"].conditions == stages[0]
