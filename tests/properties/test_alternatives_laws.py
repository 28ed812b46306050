"""Alternatives and counts: what they ask for, and that leaving some out never makes a false no."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fleet.core.model.formulas.effects import carried_out, instances
from fleet.core.model.formulas.evaluation import evaluate, expanded, negation
from fleet.core.model.formulas.nodes import (
    Compare,
    Constant,
    Formula,
    Holds,
    Not,
    Or,
    Sum,
    Total,
)
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.symbolic.action_sequences import Impossible, Subgoal, alternatives_for
from fleet.planners.symbolic.engine.alternatives import quorums
from fleet.planners.symbolic.engine.constraints import Trajectory
from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object
from tests.support.household import PLACES
from tests.support.reached import Reached, reaches

TOKENS = tuple(f"token_{n}" for n in range(6))
RELATIONS = ("<", "<=", ">", ">=", "=", "!=")
ASKED = (
    "count(x: token, up(x) = true) >= 5",
    "count(x: token, up(x) = true) = 3",
    "count(x: token, up(x) = true) != 0",
    "2 > count(x: token, up(x) = true)",
    "not count(x: token, not up(x) = true) >= 2",
    "any(x: token, up(x) = true and charged(x) = true)",
    "not any(x: token, up(x) = true)",
    "all(x: token, up(x) = true or marked(x) = true)",
    "count(x: token, up(x) = true) >= 4 and spent(robot) = false",
    "sum(x: token, up(x) = true, weight(x)) >= 13",
    "sum(x: token, up(x) = true, weight(x)) <= 4",
)
BELL, ROBOT = "bell", "arm"
UP, SPENT = "up", FactKey("spent", ROBOT)


def up(number: int) -> FactKey:
    return FactKey(UP, TOKENS[number])


@st.composite
def counts(draw: st.DrawFn) -> tuple[Formula, dict[FactKey, Value]]:
    """A comparison of a count with a number, either way round, perhaps negated; and a state."""
    number = draw(st.integers(0, len(TOKENS)))
    rows: list[Formula] = [Holds(Literal(up(n), True)) for n in range(number)]
    rows = [negation(row) if draw(st.booleans()) else row for row in rows]
    count = Sum(tuple(Total("", "", row, Constant(1)) for row in rows))
    compared = Constant(draw(st.sampled_from((-1, 0, 1, 2, 2.5, 3, 6, 7))))
    relation = draw(st.sampled_from(RELATIONS))
    swapped = draw(st.booleans())
    terms = (compared, count) if swapped else (count, compared)
    formula: Formula = Compare(terms[0], relation, terms[1])
    if draw(st.booleans()):
        formula = Not(formula)
    if draw(st.integers(0, 5)) == 0:
        formula = Or(tuple(rows))
    return formula, {up(n): draw(st.booleans()) for n in range(number)}


@reaches("met", "not met", "no quorum")
@settings(max_examples=400, deadline=None)
@given(counts())
def test_a_count_holds_where_so_many_of_its_formulas_do(
    reached: Reached, drawn: tuple[Formula, dict[FactKey, Value]]
) -> None:
    formula, values = drawn
    world = WorldModel.of({}, PLACES, (), (), ())
    needed = quorums(formula)
    if needed is None:
        reached["no quorum"] += 1
        return
    met = all(
        sum(evaluate(row, values.get, world) for row in quorum.of) >= quorum.least
        for quorum in needed
    )
    assert met is evaluate(formula, values.get, world)
    reached["met" if met else "not met"] += 1


@st.composite
def worlds(draw: st.DrawFn) -> tuple[WorldModel, Trajectory]:
    """Tokens that go up and down; those that are marked wear out who lifts them, and only charged
    ones that are up restore that. A bell rings when what it asks for holds."""
    lift = {
        "parameters": {"robot": "robot", "x": "token"},
        "before": ["spent(robot) = false"],
        "after": ["up(x) = true", "if marked(x) = true: spent(robot) = true"],
    }
    lower = {
        "parameters": {"robot": "robot", "x": "token"},
        "before": ["spent(robot) = false"],
        "after": ["up(x) = false"],
    }
    rest = {
        "parameters": {"robot": "robot"},
        "before": ["any(x: token, up(x) = true and charged(x) = true)"],
        "after": ["spent(robot) = false"],
    }
    ring = {
        "parameters": {"robot": "robot", "bell": "bell"},
        "before": [draw(st.sampled_from(ASKED))],
        "after": ["rung(bell) = true"],
    }
    data = {"lift": lift, "lower": lower, "rest": rest, "ring": ring}
    left_out = draw(st.sampled_from((None, None, None, "lower", "rest")))
    data = {name: skill | {"duration_s": 10} for name, skill in data.items() if name != left_out}
    skills = skills_from_data({"skills": data}, "own.yaml")
    objects = [
        Object(object=name, kind="token", label=name, movable=False, properties={"weight": n})
        for n, name in enumerate(TOKENS)
    ]
    objects.append(Object(object=BELL, kind="bell", label=BELL, movable=False))
    known: dict[FactKey, Value] = {SPENT: draw(st.sampled_from((False, False, True)))}
    for name in TOKENS:
        for relation in (UP, "marked", "charged"):
            known[FactKey(relation, name)] = draw(st.booleans())
    robot = RobotSpec(robot=ROBOT, model=ROBOT, skills=tuple(skills), capabilities={})
    facts = [Fact.of(Literal(key, value), "test") for key, value in known.items()]
    subject = draw(st.sampled_from(TOKENS))
    constraints = {
        0: Trajectory(never=(Condition(relation=UP, subject=subject, value=True),)),
        1: Trajectory(never=(Condition(relation="spent", subject=ROBOT, value=True),)),
        2: Trajectory(always=(Condition(relation=UP, subject=subject, value=True),)),
        3: Trajectory(
            never=(Condition(relation=UP, subject=TOKENS[0], any_of=TOKENS[:2], value=True),)
        ),
    }
    way = constraints.get(draw(st.integers(0, 8)), Trajectory())
    return WorldModel.of(skills, PLACES, objects, (robot,), facts), way


@reaches("found", "impossible", "with constraints", "impossible only by constraints")
@settings(max_examples=150, deadline=None)
@given(worlds())
def test_there_is_a_sequence_where_a_search_of_all_states_finds_one(
    reached: Reached, drawn: tuple[WorldModel, Trajectory]
) -> None:
    world, way = drawn
    assume(allowed(dict(world.facts), way))  # else the checker says so
    wanted = Condition(relation="rung", subject=BELL, value=True)
    found = alternatives_for(
        Subgoal("g", wanted), dict(world.facts), world, TimeBudget(inf), on_the_way=way
    )
    possible = can_be_rung(world, way)
    assert isinstance(found, tuple) is possible, found
    assert possible or isinstance(found, Impossible)
    reached["found" if possible else "impossible"] += 1
    reached["with constraints"] += bool(way) and possible
    reached["impossible only by constraints"] += not possible and can_be_rung(world, Trajectory())


def can_be_rung(world: WorldModel, way: Trajectory) -> bool:
    """A search of all states, without any cleverness."""
    actions = list(every_action(world))
    begin = dict(world.facts)
    seen, open_ = {frozenset(begin.items())}, [begin]
    while open_:
        facts = open_.pop()
        for action in actions:
            if not can_be_done(action, facts, world):
                continue
            after = facts | dict(effects(action, facts, world))
            if not allowed(after, way):
                continue
            if after.get(FactKey("rung", BELL)) is True:
                return True
            if (state := frozenset(after.items())) not in seen:
                seen.add(state)
                open_.append(after)
    return False


def every_action(world: WorldModel) -> Iterator[Action]:
    for skill in world.skills.values():
        of = {"x": TOKENS, "bell": (BELL,)}
        more = next((name for name in skill.parameters if name != "robot"), None)
        for value in of[more] if more else (None,):
            yield skill.ground(
                {"robot": ROBOT} | ({more: value} if more and value is not None else {})
            )


def can_be_done(action: Action, facts: dict[FactKey, Value], world: WorldModel) -> bool:
    return all(facts.get(row.variable) == row.value for row in action.before) and all(
        evaluate(expanded(row, world), facts.get, world) for row in action.conditions
    )


def effects(
    action: Action, facts: dict[FactKey, Value], world: WorldModel
) -> Iterator[tuple[FactKey, Value]]:
    for literal in action.after:
        yield literal.variable, literal.value
    rows = (row for effect in action.conditional for row in instances(effect, world))
    for literal in carried_out(rows, facts.get, world):
        yield literal.variable, literal.value


def allowed(facts: dict[FactKey, Value], way: Trajectory) -> bool:
    def holds(condition: Condition) -> bool:
        return any(
            facts.get(FactKey(condition.relation, s)) == condition.value for s in condition.subjects
        )

    return all(map(holds, way.always)) and not any(map(holds, way.never))
