"""Laws of where things are: in one place, never in themselves, and where their carriers go."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from hypothesis import given, settings
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.indexes.fleet_index import index_of
from fleet.core.model.derived import carriers, holds, is_closed, read_by
from fleet.core.model.eligibility import lacks
from fleet.core.model.preconditions import applicable, made_true
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from keyexpr_schema.facts import (
    AT,
    BLOCKED_BY,
    HOLDING,
    IN,
    IS_OPEN,
    NOTHING,
    ON,
    FactKey,
    Literal,
    Value,
)
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place
from tests.support.household import SKILLS
from tests.support.reached import Reached, reaches

PLACES = (
    Place(place="flat", label="Flat"),
    Place(place="kitchen", label="Kitchen", part_of="flat"),
    Place(place="hallway", label="Hallway", part_of="flat"),
)
THINGS = (
    Object(object="table", kind="table", label="table", features=("supports",), movable=False),
    Object(
        object="cupboard",
        kind="cupboard",
        label="cupboard",
        features=("contains", "openable"),
        movable=False,
        home="kitchen",
        room=2,
    ),
    Object(
        object="shelf",
        kind="shelf",
        label="shelf",
        features=("supports",),
        part_of="cupboard",
        blocked_by=("box",),
    ),
    Object(object="bowl", kind="bowl", label="bowl", features=("contains",)),
    Object(object="box", kind="box", label="box", features=("contains", "openable")),
    Object(object="tray", kind="tray", label="tray", features=("supports",)),
    Object(object="fork", kind="fork", label="fork"),
    Object(object="anna", kind="person", label="Anna", movable=False),
)
ROBOTS = (
    RobotSpec(
        robot="arm",
        model="arm",
        skills=tuple(SKILLS),
        capabilities={"drive": 0.6, "see": 4.0, "grip": 5.0, "reach": 2.0},
    ),
    RobotSpec(
        robot="cart",
        model="cart",
        skills=("navigate",),
        capabilities={"drive": 0.6, "basket": 2.0},
    ),
)
WORLD = WorldModel.of(SKILLS, PLACES, THINGS, ROBOTS, ())
NAMES = [thing.object for thing in THINGS]
CARRYING = {"table", "cupboard", "shelf", "bowl", "box", "tray"}
ROOMS = ["kitchen", "hallway"]
WHERE = st.sampled_from([*ROOMS, *NAMES, "arm", "cart", "floor", None])
FACTS = st.builds(
    lambda subject, relation, value, time_s, source: Fact(
        subject=subject, relation=relation, value=value, time_s=time_s, source=source
    ),
    st.sampled_from(NAMES),
    st.sampled_from([AT, ON, IN]),
    WHERE,
    st.integers(1, 6).map(float),
    st.sampled_from(["arm", "cart", "person"]),
)


def chain(subject: str, facts: Mapping[FactKey, Value]) -> list[str]:
    return list(carriers(subject, facts.get, WORLD, aboard=True))


def places_of(subject: str, facts: Mapping[FactKey, Value]) -> list[str]:
    """The places where it is, by what holds of each."""
    return [
        place.place
        for place in PLACES
        if holds(Literal(FactKey(AT, subject), place.place), facts.get, WORLD, aboard=True)
    ]


def check_one_place(facts: Mapping[FactKey, Value]) -> None:
    for name in NAMES:
        assert places_of(name, facts) in ([], ["flat"], ["flat", "kitchen"], ["flat", "hallway"])
        assert name not in chain(name, facts)


def knowing_all() -> State:
    state = State(logic=LOGIC)
    for place in PLACES:
        state = step(state, events.PlacePut(**_times(), place=place))[0]
    for spec in ROBOTS:
        state = step(state, events.RobotRegistered(**_times(), spec=spec))[0]
    return state


def _times() -> dict[str, float]:
    return {"time_s": 10.0, "wall_time_s": 10.0, "monotonic_s": 10.0}


@reaches("on", "late", "finer")
@given(st.lists(FACTS, max_size=12), st.lists(st.booleans(), min_size=12, max_size=12))
def test_nothing_is_in_two_places_and_the_newest_word_holds(
    reached: Reached, said: list[Fact], known_first: list[bool]
) -> None:
    state = knowing_all()
    things = iter(THINGS)
    told: list[Fact] = []
    for fact, first in zip(said, known_first, strict=False):
        if first and (thing := next(things, None)) is not None:
            state = step(state, events.ObjectPut(**_times(), object=thing))[0]
        state = step(state, events.FactPut(**_times(), fact=fact))[0]
        told.append(fact)
    for thing in things:
        reached["late"] += any(fact.value == thing.object for fact in told)
        state = step(state, events.ObjectPut(**_times(), object=thing))[0]
    values = {key: fact.value for key, fact in state.facts.items()}
    for key, value in values.items():  # of a thing, `at` alone says where it is
        assert key.relation not in (ON, IN) or value not in {*NAMES, "arm", "cart"}
    check_one_place(values)
    fresh = index_of(
        state.plans, state.goals, state.goal_states, state.facts, state.objects, state.index.team
    )
    assert (fresh.things_at, fresh.said_on, fresh.parts) == (
        state.index.things_at, state.index.said_on, state.index.parts
    )  # fmt: skip
    # Who was said to lie on a floor later than on a thing that nobody knew yet lies on the floor.
    outdated = {f.subject for f in told if not _is_where(f)}
    for name in set(NAMES) - outdated:
        about = [f for f in told if f.subject == name and _is_where(f) and _is_possible(f)]
        newest = max((f.time_s for f in about), default=None)
        last = [f for f in about if f.time_s == newest]
        reached["on"] += any(f.relation != AT for f in last)
        value = values.get(FactKey(AT, name))
        # It may be unknown, where it would have been in itself.
        if value is not None and last:
            assert value in {f.value for f in last}
            reached["finer"] += len({f.value for f in last}) > 1


def _is_where(fact: Fact) -> bool:
    return fact.relation == AT or fact.value in {*NAMES, "arm", "cart"}


def _is_possible(fact: Fact) -> bool:
    return fact.value != fact.subject and (fact.subject, fact.value) != ("cupboard", "shelf")


def start() -> dict[FactKey, Value]:
    return {
        FactKey(AT, "table"): "hallway",
        FactKey(AT, "bowl"): "table",
        FactKey(AT, "box"): "kitchen",
        FactKey(AT, "tray"): "table",
        FactKey(AT, "fork"): "bowl",
        FactKey(AT, "anna"): "hallway",
        FactKey(AT, "arm"): "kitchen",
        FactKey(AT, "cart"): "hallway",
        FactKey(HOLDING, "arm"): NOTHING,
        FactKey(IS_OPEN, "cupboard"): True,
    }


def ground() -> Iterator[Action]:
    for skill in SKILLS.values():
        rows: list[dict[str, str]] = [{}]
        for name, kind in skill.parameters.items():
            choices = WORLD.of_type(kind)
            rows = [{**row, name: choice} for row in rows for choice in sorted(choices)]
        for args in rows:
            action = skill.ground(args)
            robots = action.participants
            if len(set(robots)) == len(robots) and not any(
                lacks(WORLD, action.args[name], action, name) for name in skill.robot_parameters
            ):
                yield action


ACTIONS = tuple(ground())


@reaches("pick", "place_in", "place_on", "hand_over", "open", "close", "carried along", "closed")
@settings(max_examples=50)
@given(st.lists(st.integers(0, 10_000), min_size=15, max_size=30))
def test_whatever_the_household_does_things_are_in_one_place_and_follow_their_carriers(
    reached: Reached, choices: list[int]
) -> None:
    facts = start()
    for choice in choices:
        # What is seldom possible is chosen as often as what always is.
        able: dict[str, list[Action]] = {}
        for action in ACTIONS:
            if applicable(action, facts, WORLD):
                able.setdefault(action.skill.name, []).append(action)
        rows = able[sorted(able)[choice % len(able)]]
        action = rows[choice // len(able) % len(rows)]
        before = {name: chain(name, facts) for name in NAMES}
        facts.update({row.variable: row.value for row in made_true(action, facts, WORLD)})
        reached[action.skill.name] += 1
        check_one_place(facts)
        for name in NAMES:
            around = chain(name, facts)
            if around and around[0] in CARRYING:  # with what carries it, wherever that goes
                assert around[1:] == chain(around[0], facts)
                reached["carried along"] += before[name][:1] == around[:1] and (
                    before[name] != around
                )
            closed = any(is_closed(carrier, facts.get, WORLD) for carrier in around)
            reached["closed"] += closed
            if action.skill.name == "pick" and action.args["object"] == name:
                assert not any(is_closed(c, facts.get, WORLD) for c in before[name])


@reaches("read", "not read")
@given(
    st.dictionaries(st.sampled_from(NAMES), st.sampled_from([*ROOMS, *NAMES, "arm", "cart"])),
    st.dictionaries(st.sampled_from(["table", "cupboard", "shelf"]), st.sampled_from(NAMES)),
    st.sampled_from(NAMES),
    st.sampled_from([AT, ON, IN, "reachable", "held", "located"]),
    st.sampled_from([*ROOMS, *NAMES, True]),
    st.booleans(),
    st.sampled_from(
        [FactKey(AT, name) for name in (*NAMES, "arm", "cart")]
        + [FactKey(HOLDING, "arm"), FactKey(BLOCKED_BY, "table"), FactKey(BLOCKED_BY, "shelf")]
        + [FactKey(IS_OPEN, name) for name in NAMES]
    ),
    st.sampled_from([*ROOMS, *NAMES, True, None]),
)
def test_no_other_variable_than_those_that_may_be_read_changes_what_holds(
    reached: Reached,
    where: dict[str, str],
    blocked: dict[str, str],
    subject: str,
    relation: str,
    value: str | bool,
    aboard: bool,
    changed: FactKey,
    to: Value,
) -> None:
    facts: dict[FactKey, Value] = {FactKey(AT, name): at for name, at in where.items()}
    facts |= {FactKey(BLOCKED_BY, name): by for name, by in blocked.items()}
    literal = Literal(FactKey(relation, subject), value)
    read = read_by(literal, lambda key: {facts.get(key)}, WORLD, aboard=aboard)
    if changed in read:
        reached["read"] += 1
        return
    other = {**facts, changed: to}
    assert holds(literal, facts.get, WORLD, aboard=aboard) == holds(
        literal, other.get, WORLD, aboard=aboard
    )
    reached["not read"] += 1
