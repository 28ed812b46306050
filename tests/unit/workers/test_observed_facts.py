"""What a worker says of what it has seen, and of what it sees no more."""

from __future__ import annotations

from unittest.mock import AsyncMock

import pytest
from msgspec.structs import replace

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.facts import AT, HOLDING, NOTHING, FactKey, Value
from keyexpr_schema.payloads.motions import Detection, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.world import Fact, Place
from sim.files.mission_file import load_mission
from sim.server.process import make_backend
from tests.support.worker_world import BackendBody, LiveWorld
from workers.errors import SkillFailed
from workers.host_clock import running_s
from workers.seen_facts import SeenFacts
from workers.skill_context import SkillContext
from workers.world_cache import WorldCache


@pytest.mark.parametrize(("thought_s", "said_s"), [(2.0, 2.0), (None, 8.0), (9.0, 8.0), (0.0, 8.0)])
def test_that_a_thing_is_not_where_it_was_thought_says_nothing_against_who_has_seen_it_since(
    thought_s: float | None, said_s: float
) -> None:
    backend = make_backend(load_mission("two-cups"), "kinematic")
    backend.time_s = 8.0
    cache = WorldCache()
    if thought_s is not None:
        known = Fact(relation=AT, subject="cup_1", value="hsr", source="ana", time_s=thought_s)
        cache.facts[known.key] = known
    spec = load_mission("two-cups").robots[0].spec
    context = SkillContext(spec, BackendBody(LiveWorld(backend), spec.robot), cache)
    context.observe(AT, "cup_1", None)
    (gone,) = context.observed
    assert (gone.value, gone.time_s) == (None, said_s)
    # What it has seen itself in this attempt is newer.
    context.observe(AT, "cup_1", "kitchen")
    context.observe(AT, "cup_1", None)
    assert context.observed[0].time_s == 8.0


def test_what_nobody_could_read_is_no_fact() -> None:
    """In a journal it would keep the worker from starting ever again."""
    context = hand(WorldCache())
    with pytest.raises(SchemaError, match="cup 1"):
        context.observe(AT, "cup 1", "kitchen")
    failure = SkillFailed("it slipped", facts=((AT, "cup 1", None), (AT, "cup_1", None)))
    context.observe_failure(failure)
    assert [fact.subject for fact in context.observed] == ["cup_1"]


def hand(cache: WorldCache, seen: SeenFacts | None = None) -> SkillContext:
    """An attempt of the robot with the hand, none of whose sensors is asked."""
    backend = make_backend(load_mission("two-cups"), "kinematic")
    backend.time_s = 8.0
    spec = load_mission("two-cups").robots[0].spec
    return SkillContext(spec, BackendBody(LiveWorld(backend), spec.robot), cache, seen)


def senses(holding: str | None, *basket: str) -> Senses:
    pose_m_rad = (0.0, 0.0, 0.0)
    return Senses(
        robot="hsr", time_s=8.0, pose_m_rad=pose_m_rad, place=None, holding=holding, basket=basket
    )


def said(context: SkillContext) -> dict[tuple[str, str], Value]:
    return {(fact.relation, fact.subject): fact.value for fact in context.observed}


def test_what_a_hand_has_let_go_of_is_not_with_the_robot_any_more() -> None:
    context = hand(WorldCache())
    context.observe_carried(senses("cup_1"))
    assert said(context) == {(HOLDING, "hsr"): "cup_1", (AT, "cup_1"): "hsr"}
    context.observe_carried(senses(None))
    assert said(context) == {(HOLDING, "hsr"): NOTHING, (AT, "cup_1"): None}
    # Taken up again, it is there; and what is in the hand now says nothing of it.
    context.observe_carried(senses("cup_1"))
    context.observe_carried(senses("cup_2"))
    assert said(context) == {
        (HOLDING, "hsr"): "cup_2", (AT, "cup_1"): None, (AT, "cup_2"): "hsr"
    }  # fmt: skip


def test_what_the_hand_was_said_to_hold_and_does_not_is_where_nobody_knows() -> None:
    """Dropped while nobody looked: between two attempts, or before the worker was started."""
    cache = WorldCache()
    for relation, subject, value in ((HOLDING, "hsr", "cup_1"), (AT, "cup_1", "hsr")):
        fact = Fact(relation=relation, subject=subject, value=value, source="hsr", time_s=2.0)
        cache.facts[fact.key] = fact
    context = hand(cache)
    context.observe_carried(senses(None))
    assert said(context) == {(HOLDING, "hsr"): NOTHING, (AT, "cup_1"): None}


def test_what_went_from_the_hand_into_the_basket_is_with_the_robot() -> None:
    context = hand(WorldCache())
    context.observe_carried(senses("cup_1"))
    context.observe_carried(senses(None, "cup_1"))
    assert said(context) == {(HOLDING, "hsr"): NOTHING, (AT, "cup_1"): "hsr"}
    of_hand, of_basket = (fact.time_s for fact in context.observed)
    assert of_basket >= of_hand, "or it would seem to be from before the hand was seen empty"


@pytest.mark.parametrize("place", ["table", "locobot", None])
def test_what_others_say_since_of_a_thing_that_was_taken_out_of_the_hand_holds(
    place: str | None,
) -> None:
    """A person took it, or another robot, and has said where it is: nobody has to look for it."""
    cache = WorldCache()
    context = hand(cache)
    context.observe_carried(senses("cup_1", "cup_2"))
    context.observe(AT, "cup_2", "hsr")
    for thing in ("cup_1", "cup_2"):
        word = Fact(relation=AT, subject=thing, value=place, source="ana", time_s=8.5)
        cache.facts[word.key] = word
        cache.heard_s[word.key] = running_s() + 1e-6
    context.observe_carried(senses(None))
    assert said(context) == {(HOLDING, "hsr"): NOTHING}
    # What it sees itself is newer than that.
    context.observe_carried(senses("cup_1"))
    context.observe_carried(senses(None))
    assert said(context)[AT, "cup_1"] is None


def test_what_the_attempt_before_has_had_in_its_hand_need_not_have_been_heard_of() -> None:
    """It is on its way to the store still, where the router is away or slow."""
    cache, seen = WorldCache(), SeenFacts()
    for relation, subject, value in ((HOLDING, "hsr", NOTHING), (AT, "cup_1", "kitchen")):
        fact = Fact(relation=relation, subject=subject, value=value, source="hsr", time_s=2.0)
        cache.facts[fact.key], cache.heard_s[fact.key] = fact, running_s()
    hand(cache, seen).observe_carried(senses("cup_1"))
    after = hand(cache, seen)
    after.observe_carried(senses(None))
    assert said(after) == {(HOLDING, "hsr"): NOTHING, (AT, "cup_1"): None}
    assert {fact.time_s for fact in after.observed} == {8.0}, "it is later than what it was before"


async def test_what_eyes_see_in_a_basket_without_a_sensor_is_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    context = hand(WorldCache())
    context.world.specs["hsr"] = context.spec

    def seen(support: str) -> None:
        cup = Detection(
            object="cup_1", kind="cup", point_m=(0.0, 0.0, 0.0), place="kitchen", support=support
        )
        found = (cup,)
        outcome = MotionOutcome(state=MotionState.SUCCEEDED, senses=senses(None), detections=found)
        monkeypatch.setattr(context, "do", AsyncMock(return_value=outcome))

    context.observe_carried(senses("cup_1"))
    seen("hsr")
    await context.look()
    context.observe_carried(senses(None))
    assert said(context)[AT, "cup_1"] == "hsr"
    seen("floor")
    await context.look()
    context.observe_carried(senses(None))
    assert said(context)[AT, "cup_1"] == "kitchen"


def believed(cache: WorldCache, value: Value, source: str = "ana", relation: str = AT) -> None:
    subject = "cup_1" if relation == AT else "hsr"
    word = Fact(relation=relation, subject=subject, value=value, source=source, time_s=2.0)
    cache.facts[word.key], cache.heard_s[word.key] = word, running_s()


def with_places(cache: WorldCache) -> WorldCache:
    cache.places.update((name, Place(place=name, label=name)) for name in ("kitchen", "hallway"))
    return cache


@pytest.mark.parametrize(("basket", "sensor"), [(False, False), (True, False), (True, True)])
def test_what_is_said_to_be_with_a_robot_and_is_not_in_its_basket_is_in_its_hand(
    basket: bool, sensor: bool
) -> None:
    """Somebody has given it, taken it back, and said that the hand is empty: each word of that may
    have come alone. Where there is a basket without a sensor, it may be there."""
    cache = WorldCache()
    believed(cache, "hsr")
    believed(cache, NOTHING, relation=HOLDING)
    context = hand(cache)
    if basket:
        context.spec = replace(
            context.spec, capabilities={**context.spec.capabilities, "basket": 1.0}
        )
    context.observe_carried(replace(senses(None), basket_sensor=sensor))
    assert ((AT, "cup_1") in said(context)) is (sensor or not basket)
    assert said(context).get((AT, "cup_1")) is None


def test_what_others_say_of_a_thing_since_is_known() -> None:
    context = hand(with_places(WorldCache()))
    context.observe(AT, "cup_1", "kitchen")
    assert context.known(AT, "cup_1") == "kitchen"
    believed(context.world, "hallway")
    assert context.known(AT, "cup_1") == "hallway"
    context.observe_missing("cup_1", "kitchen")
    assert said(context)[AT, "cup_1"] == "kitchen", "nothing is said against what they say"
    context.observe_missing("cup_1", "hallway")
    assert said(context)[AT, "cup_1"] is None


def test_what_the_attempt_before_has_seen_is_known_before_the_store_has_it() -> None:
    cache, seen = with_places(WorldCache()), SeenFacts()
    believed(cache, "kitchen")
    hand(cache, seen).observe(AT, "cup_1", "hallway")
    after = hand(cache, seen)
    assert after.known(AT, "cup_1") == "hallway"
    after.observe_missing("cup_1", "kitchen")
    assert said(after) == {}


def test_that_nobody_knows_of_a_thing_is_no_news_where_nobody_knows() -> None:
    """Somebody may have said in between where it is, who has not been heard yet."""
    cache, seen = WorldCache(), SeenFacts()
    believed(cache, None)
    heard_s = cache.heard_s[FactKey(AT, "cup_1")]
    context = hand(cache, seen)
    context.observe(AT, "cup_1", None)
    (fact,) = context.observed
    assert (fact.time_s, seen.seen_s(fact)) == (2.0, heard_s)


def test_what_was_seen_again_and_again_is_not_remembered_for_ever():
    """Of many facts of one variable that an attempt has seen only the last is sent."""
    seen = SeenFacts()
    for number in range(30):
        for time_s in range(10):
            cup, at_s = f"cup_{number}", float(time_s)
            fact = Fact(subject=cup, relation="at", value="table", source="hsr", time_s=at_s)
            seen.note(fact, 10.0 * number + time_s)
        seen.forget_first(beyond=20)
        assert len(seen) == min(10 * (number + 1), 20)
    assert seen.last(fact.key) == fact
    assert [each.subject for each in seen.all_last()] == ["cup_28", "cup_29"]
