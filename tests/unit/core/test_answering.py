"""Questions are answered from what is believed, with who said so and how long ago."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.answering import answer
from fleet.core.model.skills import state_words_of
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.questions import QuestionQuery, QuestionReply
from keyexpr_schema.payloads.requests import Control, ControlRequest
from keyexpr_schema.payloads.world import Fact, Object, Statement
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import SKILLS, bring


def _asked(model: FleetModel, text: str) -> QuestionReply:
    return answer(model.state, QuestionQuery(text=text))


def _told(model: FleetModel, subject: str, value: str | None) -> None:
    fact = Fact(subject=subject, relation=AT, value=value, source="anna", time_s=model.state.time_s)
    model.receive(events.FactPut, fact=fact)


def test_where_a_thing_is_with_who_said_so() -> None:
    model = fleet()
    _told(model, "cup_1", "hallway")
    reply = _asked(model, "Where is cup 1?")
    assert reply.subjects == ("cup_1",)
    assert "in the hallway" in (reply.answer or "").casefold()
    (fact,) = reply.facts
    assert (fact.value, fact.source) == ("hallway", "anna")
    assert fact.age_s >= 0.0
    assert reply.offer is None


def test_the_first_one_is_no_other() -> None:
    model = fleet()
    _told(model, "cup_1", "hallway")
    for words, meant in (("the first cup", "cup_1"), ("the last cup", "cup_2")):
        assert _asked(model, f"Where is {words}?").subjects == (meant,)
        assert _asked(model, f"Who has {words}?").subjects in ((), (meant,))
    both = _asked(model, "Where are the second cup and the first cup?")
    assert both.subjects == ("cup_2", "cup_1")
    counted = _asked(model, "How many of the first two cups are in the hallway?")
    assert (counted.answer or "").startswith("1")
    assert "there is no 'the third cup'" in (_asked(model, "Where is the third cup?").reason or "")


def test_what_is_no_question_is_told_how_to_ask() -> None:
    model = fleet()
    for text in ("foo", "the kitchen", "Paint the door"):
        reason = _asked(model, text).reason or ""
        assert "is not understood as a question: ask it like " in reason
        assert "say it like" not in reason
    assert "'hello' ends before it says what to do: ask" in (_asked(model, "hello").reason or "")
    assert "'foo' is not a known object" in (_asked(model, "bring foo").reason or "")


def test_what_nobody_knows_comes_with_a_goal_that_would_find_out() -> None:
    model = fleet()
    _told(model, "cup_1", None)
    reply = _asked(model, "Where is cup 1?")
    assert "nobody knows where" in (reply.answer or "")
    assert reply.offer == "find cup_1"
    model.receive(events.GoalPut, goal=Goal(goal="g", text=reply.offer))
    assert model.goal_states["g"].reason is None
    _told(model, "cup_2", None)
    both = _asked(model, "Where are the cups?")
    assert both.offer == "find cup_1 and cup_2"
    model.receive(events.GoalPut, goal=Goal(goal="h", text=both.offer))
    assert {row.subject for row in model.goal_states["h"].conditions} == {"cup_1", "cup_2"}


def test_how_many_and_which_count_those_that_are_known() -> None:
    model = fleet()
    _told(model, "cup_1", "hallway")
    _told(model, "cup_2", "hallway")
    reply = _asked(model, "How many cups are in the hallway?")
    assert reply.subjects == ("cup_1", "cup_2")
    assert (reply.answer or "").startswith("2:")
    _told(model, "cup_2", None)
    reply = _asked(model, "Which cups are in the hallway?")
    assert reply.subjects == ("cup_1",)
    assert "nobody knows" in (reply.answer or "")


def test_whether_something_is_so_is_yes_no_or_unknown() -> None:
    model = fleet()
    _told(model, "cup_1", "hallway")
    assert _asked(model, "Is cup 1 in the hallway?").holds is True
    assert _asked(model, "Is cup 1 in the kitchen?").holds is False
    _told(model, "cup_1", None)
    unknown = _asked(model, "Is cup 1 in the kitchen?")
    assert unknown.holds is None
    assert unknown.offer == "find cup_1"


def test_whether_any_is_so_is_asked_of_each() -> None:
    model = fleet()
    for cup in ("cup_1", "cup_2"):
        _told(model, cup, "hallway")
    reply = _asked(model, "Are there any cups in the hallway?")
    assert (reply.holds, reply.subjects) == (True, ("cup_1", "cup_2"))
    assert _asked(model, "Are there any cups in the kitchen?").holds is False
    _told(model, "cup_2", None)
    unknown = _asked(model, "Are there any cups in the kitchen?")
    assert (unknown.holds, unknown.offer) == (None, "find cup_2")


def test_who_has_a_thing_and_what_robots_do_and_can() -> None:
    model = fleet()
    _told(model, "cup_1", "locobot")
    assert _asked(model, "Who has cup 1?").subjects == ("locobot",)
    assert _asked(model, "What are you doing?").answer is not None
    able = _asked(model, "What can the hsr do?")
    assert able.subjects == ("hsr",)
    assert "place on robot" in (able.answer or "")
    assert set(_asked(model, "What can you do?").subjects) == {"hsr", "locobot"}
    assert _asked(model, "Can the hsr grab cups?").holds is True
    assert _asked(model, "Can the locobot grab cups?").holds is False
    model.plan(Goal(goal="g", text="Bring cup 2 to the hallway"))
    reply = _asked(model, "What is the hsr doing?")
    assert "plan-1" in (reply.answer or "")


def _fixed(label: str, *features: str) -> Object:
    name = label.lower()
    return Object(
        object=name, kind=name, label=label, home="kitchen", movable=False, features=features
    )


def _with_fridge_and_anna() -> FleetModel:
    model = fleet()
    policy = replace(model.state.policy, state_words=state_words_of(SKILLS))
    model.state = replace(model.state, policy=policy)
    for thing in (_fixed("fridge", "contains", "openable"), _fixed("Anna", "person")):
        model.receive(events.ObjectPut, object=thing)
    return model


def test_who_is_somewhere_is_asked_of_robots_and_people_alone() -> None:
    model = _with_fridge_and_anna()
    for name in ("cup_1", "anna"):
        _told(model, name, "kitchen")
    assert _asked(model, "Who is in the kitchen?").subjects == ("anna",)
    _told(model, "hsr", "kitchen")
    assert _asked(model, "Who is in the kitchen?").subjects == ("hsr", "anna")
    assert "cup_1" in _asked(model, "What is in the kitchen?").subjects


def test_states_are_said_in_words_with_the_sentence_that_told_them() -> None:
    model = _with_fridge_and_anna()
    told = Statement(statement="s", text="The fridge is shut.")
    model.receive(events.StatementPut, statement=told)
    reply = _asked(model, "Is the fridge open?")
    assert reply.holds is False
    assert (reply.answer or "").startswith("no: the fridge is closed (said ")
    assert "“The fridge is shut.”" in (reply.answer or "")


def test_i_of_a_statement_is_whoever_says_it() -> None:
    model = _with_fridge_and_anna()
    said = Statement(statement="s", text="I am in the hallway.", speaker="anna")
    model.receive(events.StatementPut, statement=said)
    assert _asked(model, "Who is in the hallway?").subjects == ("anna",)
    model.receive(events.StatementPut, statement=replace(said, statement="t", speaker="nobody"))
    assert "'nobody', who says it, is no person" in (model.state.statement_states["t"].reason or "")


def test_what_nobody_knows_of_a_thing_whose_place_is_known_is_looked_for_there() -> None:
    model = _with_fridge_and_anna()
    reply = _asked(model, "Is the fridge open?")
    assert (reply.holds, reply.offer) == (None, "search kitchen")
    assert reply.answer == "nobody knows whether the fridge is open"
    looked = Fact(subject="kitchen", relation="searched", value=True, source="hsr", time_s=1.0)
    model.receive(events.FactPut, fact=looked)
    assert _asked(model, "Is the fridge open?").offer is None


def _later(model: FleetModel, seconds: float) -> None:
    model.time_s += seconds
    model.state = replace(model.state, time_s=model.time_s)


def test_what_was_said_long_ago_is_said_to_be_so_and_looked_for_again() -> None:
    model = fleet()
    _told(model, "cup_1", "hallway")
    _later(model, 5_400.0)
    reply = _asked(model, "Where is cup 1?")
    assert (
        reply.answer == "cup 1 is in the hallway (said 90 min ago by anna, and not confirmed since)"
    )
    assert reply.offer == "search hallway"
    assert _asked(model, "Is cup 1 in the hallway?").offer == "search hallway"
    _told(model, "cup_2", "hallway")
    both = _asked(model, "How many cups are in the hallway?")
    assert both.answer == "2: cup 1, cup 2 (said 1 s to 90 min ago)"
    _told(model, "cup_1", "hallway")
    assert (
        _asked(model, "Where is cup 1?").answer == "cup 1 is in the hallway (said 1 s ago by anna)"
    )


def test_what_was_taken_back_is_said_with_who_did_so() -> None:
    model = _with_fridge_and_anna()
    _told(model, "cup_1", "hallway")
    _told(model, "cup_1", None)
    lost = _asked(model, "Who has cup 1?")
    assert lost.answer == "nobody knows where cup 1 is (said 1 s ago by anna)"
    assert lost.offer == "find cup_1"
    said = Statement(statement="s", text="The fridge is open.")
    model.receive(events.StatementPut, statement=said)
    known = model.state.facts[FactKey("is_open", "fridge")]
    unsaid = replace(known, value=None, source="anna", time_s=model.time_s)
    model.receive(events.FactPut, fact=unsaid)
    reply = _asked(model, "Is the fridge open?")
    assert (reply.holds, reply.offer) == (None, "search kitchen")
    assert "nobody knows whether the fridge is open (said 1 s ago by anna)" in str(reply.answer)


def test_nothing_is_denied_of_where_nobody_has_looked() -> None:
    model = _with_fridge_and_anna()
    for text, offer in (
        ("What is in the fridge?", "search fridge"),
        ("Is there anything in the fridge?", "search fridge"),
        ("Who is in the hallway?", "search hallway"),
    ):
        reply = _asked(model, text)
        assert reply.offer == offer
        assert "that is known" in str(reply.answer) and "nobody has searched" in str(reply.answer)
        assert reply.holds is None
        model.receive(events.GoalPut, goal=Goal(goal="g", text=offer))
        assert model.goal_states["g"].reason is None
        model.receive(events.GoalDeleted, goal="g")
    looked = Fact(subject="fridge", relation="searched", value=True, source="hsr", time_s=1.0)
    model.receive(events.FactPut, fact=looked)
    reply = _asked(model, "Is there anything in the fridge?")
    assert (reply.answer, reply.holds, reply.offer) == ("no", False, None)


def test_how_sure_it_is_where_things_and_robots_stand_that_nobody_speaks_of() -> None:
    model = _with_fridge_and_anna()
    reply = _asked(model, "Where is the fridge?")
    assert reply.answer == "the fridge is in the kitchen (where it belongs; nobody has said so)"
    _told(model, "hsr", "hallway")
    model.lose("hsr")
    assert str(_asked(model, "Where is the hsr?").answer).endswith(", and is not connected")


def test_what_is_no_question_is_said_so() -> None:
    model = fleet()
    assert "robotctl goal add" in (_asked(model, "Bring cup 1 to the hallway").reason or "")
    assert _asked(model, "Where is the unicorn?").answer is None
    assert "unicorn" in (_asked(model, "Where is the unicorn?").reason or "")


def test_whoever_speaks_must_be_known_in_goals_questions_and_tasks_alike() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    refused = "'nobody', who says it, is no person that is known; known are none"
    reply = answer(model.state, QuestionQuery(text="Where is my cup?", speaker="nobody"))
    assert reply.reason == refused
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring me cup 2", speaker="nobody"))
    assert model.goal_states["g"].reason == refused
    args = {"text": "bring me cup 2", "speaker": "nobody"}
    asked = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="do", args=args
    )
    model.receive(events.ControlRequested, request=asked)
    assert model.replies["c"].sentence == f"'bring me cup 2': {refused}"
