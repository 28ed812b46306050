"""The engine for one subgoal, held against a search of every state there is."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count, product

from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fleet.core.model.eligibility import lacks
from fleet.core.model.preconditions import applicable, made_true
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, condition_holds
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.symbolic.action_sequences import Subgoal, alternatives_for
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.world import Object
from tests.support.household import PLACES, SKILLS, carrier, fact, manipulator
from tests.support.reached import Reached, reaches

Facts = dict[FactKey, Value]
ROOMS = tuple(place.place for place in PLACES)
TOLERANCE_S = 1e-6
MASSES_KG = (0.2, 0.2, 0.2, 9.0)


@st.composite
def scenes(draw: st.DrawFn) -> tuple[WorldModel, tuple[Condition, ...]]:
    """A cup somewhere, perhaps in a cupboard; one or two robots; something wanted of it, and
    perhaps that the cupboard is closed in the end."""
    hand = replace(manipulator(), skills=tuple(SKILLS))
    robots = [hand]
    if draw(st.booleans()):
        robots.append(carrier())
    objects = [
        Object(object="cup", kind="cup", label="cup", mass_kg=draw(st.sampled_from(MASSES_KG))),
        Object(
            object="cupboard",
            kind="cupboard",
            label="cupboard",
            movable=False,
            home=draw(st.sampled_from(ROOMS)),
            features=("contains", "openable"),
        ),
    ]
    where = draw(st.sampled_from((*ROOMS, "cupboard", "hsr")))
    facts = [
        fact("cup", "at", where),
        fact("hsr", "holding", "cup" if where == "hsr" else "nothing"),
        fact("cupboard", "is_open", draw(st.booleans())),  # type: ignore[arg-type]
    ]
    facts += [fact(spec.robot, "at", draw(st.sampled_from(ROOMS))) for spec in robots]
    relation, value = draw(
        st.sampled_from([("held", True), ("in", "cupboard"), *(("at", room) for room in ROOMS)])
    )
    wanted = [Condition(relation=relation, subject="cup", value=value)]
    if draw(st.integers(0, 2)) == 0:
        wanted.append(Condition(relation="is_open", subject="cupboard", value=False))
    return WorldModel.of(SKILLS, PLACES, objects, robots, facts), tuple(wanted)


def reached_in(facts: Facts, wanted: Sequence[Condition], world: WorldModel) -> bool:
    """Whether all that is wanted holds."""
    return all(condition_holds(facts, condition, world) for condition in wanted)


def all_actions(world: WorldModel) -> list[Action]:
    """Every action of every robot, drives included."""
    found = []
    for skill in world.skills.values():
        if skill.name in ("search", "look_into"):
            continue
        for values in product(*(world.of_type(kind) for kind in skill.parameters.values())):
            action = skill.ground(dict(zip(skill.parameters, values, strict=True)))
            if len(set(action.participants)) == len(action.participants) and not any(
                lacks(world, action.args[name], action, name) for name in skill.robot_parameters
            ):
                found.append(action)
    return found


def step(action: Action, facts: Facts, world: WorldModel) -> tuple[Facts, float]:
    """The facts after an action, and what it takes [s]."""
    took_s = world.duration_s(action, facts.get(FactKey(AT, action.actor)), action.actor)
    return {**facts, **dict(made_true(action, facts, world))}, took_s


def least_s(
    world: WorldModel, wanted: Sequence[Condition], actions: Sequence[Action]
) -> float | None:
    """The cheapest sequence of some actions, by looking at every state (Dijkstra 1959)."""
    ticket = count()
    queue: list[tuple[float, int, Facts]] = [(0.0, next(ticket), dict(world.facts))]
    closed: set[frozenset[tuple[FactKey, Value]]] = set()
    while queue:
        spent_s, _, facts = heappop(queue)
        state = frozenset(facts.items())
        if state in closed:
            continue
        closed.add(state)
        if reached_in(facts, wanted, world):
            return spent_s
        for action in actions:
            if applicable(action, facts, world):
                after, took_s = step(action, facts, world)
                heappush(queue, (spent_s + took_s, next(ticket), after))
    return None


def where_it_matters(world: WorldModel, wanted: Sequence[Condition]) -> set[Value]:
    """The places of the things that are spoken of, and where they are wanted."""
    places: set[Value] = set()
    for name in [name for condition in wanted for name in (condition.subject, condition.value)]:
        while isinstance(name, str) and name not in world.places:
            thing = world.objects.get(name)
            name = world.value(AT, name) or (thing.home if thing else None)
        places.add(name)
    return places


def cost_s(actions: Sequence[Action], world: WorldModel, wanted: Sequence[Condition]) -> float:
    """What a sequence takes; it has to be one that can be done, and reach what is wanted."""
    facts, total_s = dict(world.facts), 0.0
    for action in actions:
        assert applicable(action, facts, world), action
        facts, took_s = step(action, facts, world)
        total_s += took_s
    assert reached_in(facts, wanted, world)
    return total_s


@reaches(
    "planned", "impossible", "opened", "closed", "by a carrier", "nothing to do", "several ways"
)
@settings(max_examples=150, deadline=None)
@given(scenes())
def test_the_cheapest_sequence_is_found_and_no_is_never_false(
    reached: Reached, scene: tuple[WorldModel, tuple[Condition, ...]]
) -> None:
    world, wanted = scene
    if reached_in(dict(world.facts), wanted, world):
        reached["nothing to do"] += 1
        return
    subgoal = Subgoal("g", wanted[0], wanted[1:])
    found = alternatives_for(subgoal, dict(world.facts), world, TimeBudget(1e9))
    actions = all_actions(world)
    least = least_s(world, wanted, actions)
    if not isinstance(found, tuple):
        assert least is None, found.reason
        reached["impossible"] += 1
        return
    sequences, _ = found
    costs_s = [cost_s(sequence.actions, world, wanted) for sequence in sequences]
    assert least is not None
    assert least - min(costs_s) < TOLERANCE_S, sequences
    if min(costs_s) > least:
        # It is cheapest of those in which nothing is handed over on the way.
        places = where_it_matters(world, wanted)
        near = [a for a in actions if a.args.get("place", a.args.get("to")) in places]
        least = least_s(world, wanted, near)
        assert least is not None
        assert min(costs_s) - least < TOLERANCE_S, sequences
    skills = {action.skill.name for sequence in sequences for action in sequence.actions}
    reached["planned"] += 1
    reached["several ways"] += len(sequences) > 1
    reached["opened"] += "open" in skills
    reached["closed"] += "close" in skills
    reached["by a carrier"] += "place_on_robot" in skills
