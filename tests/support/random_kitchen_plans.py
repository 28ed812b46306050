"""Random plans with containers, counts, for-all, negation, effects that depend, and numbers.

Drawn as `tests.support.random_plans` draws: a walk of actions that can be done, loosened to what
its causal links ask for, and then hurt a little or not at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from hypothesis import strategies as st
from msgspec.structs import replace

from fleet.core.model.preconditions import applicable, first_unmet, made_true
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, condition_holds
from fleet.planners.deordering import ActionSequence, deordered
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Precedence
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.world import Object, Place
from tests.support.household import manipulator

ROBOTS = ("r1", "r2", "r3")
ALLOCATION = {f"a{number}": robot for number, robot in enumerate(ROBOTS)}
_HAND = {"robot": "robot", "object": "movable"}
SKILLS = skills_from_data(
    {
        "relations": {
            "is_open": {"of": "openable", "values": "bool"},
            "level": {"of": "jug", "values": "number"},
            "clean": {"of": "movable", "values": "bool"},
        },
        "skills": {
            "take": {
                "parameters": _HAND,
                "before": [
                    "at(object) = kitchen",
                    "reachable(object) = true",
                    "holding(robot) = nothing",
                ],
                "after": ["at(object) = robot", "holding(robot) = object"],
            },
            "put": {
                "parameters": {**_HAND, "into": "supports | contains"},
                "before": [
                    "holding(robot) = object",
                    "not openable(into) or is_open(into) = true",
                    "space(into)",
                    "object != into",
                ],
                "after": ["in(object) = into", "holding(robot) = nothing"],
            },
            "open": {
                "parameters": {"robot": "robot", "door": "openable"},
                "before": ["holding(robot) = nothing"],
                "after": ["is_open(door) = true"],
            },
            "close": {
                "parameters": {"robot": "robot", "door": "openable"},
                "before": ["is_open(door) = true"],
                "after": ["is_open(door) = false"],
            },
            "wash": {
                "parameters": {"robot": "robot", "machine": "openable"},
                "before": [
                    "is_open(machine) = false",
                    "any(x: movable, in(x) = machine)",
                    "all(x: movable, in(x) != machine or clean(x) = false)",
                ],
                "after": ["all(x: movable, if in(x) = machine: clean(x) = true)"],
            },
            "fill": {
                "parameters": {"robot": "robot", "jug": "jug"},
                "before": ["level(jug) < 2"],
                "after": ["level(jug) += 1", "if level(jug) >= 1: clean(jug) = false"],
            },
            "pour": {
                "parameters": {"robot": "robot", "jug": "jug"},
                "before": ["level(jug) >= 1"],
                "after": ["level(jug) -= 1"],
            },
            "inspect": {
                "parameters": {"robot": "robot", "at": "contains"},
                "before": [
                    "count(x: movable, in(x) = at) < 2",
                    "sum(x: movable, in(x) = at and clean(x) = true, size(x)) <= size(at)",
                ],
                "after": ["seen(at) = true"],
            },
        },
    },
    "here",
)
THINGS = (
    Object(
        object="box", kind="box", label="box", features=("contains",), room=1,
        properties={"size": 2},
    ),
    Object(
        object="washer", kind="washer", label="washer", movable=False,
        features=("contains", "openable"), room=2, properties={"size": 1.5},
    ),
    Object(object="table", kind="table", label="table", movable=False, features=("supports",)),
    Object(object="cup", kind="cup", label="cup", properties={"size": 1}),
    Object(object="jug", kind="jug", label="jug", properties={"size": 1}),
)  # fmt: skip


def _world() -> WorldModel:
    robots = tuple(replace(manipulator(name), skills=tuple(SKILLS)) for name in ROBOTS)
    model = WorldModel.of(SKILLS, (Place(place="kitchen", label="kitchen"),), THINGS, robots, ())
    return model.with_facts(
        {
            **{FactKey("at", thing): "kitchen" for thing in ("washer", "table", "box")},
            **{FactKey("holding", robot): "nothing" for robot in ROBOTS},
            FactKey("at", "cup"): "table",
            FactKey("at", "jug"): "kitchen",
            FactKey("is_open", "washer"): False,
            FactKey("level", "jug"): 1,
            **{FactKey("clean", thing): False for thing in ("cup", "jug", "box")},
        }
    )


WORLD = _world()
STARTS: tuple[dict[FactKey, Value], ...] = (
    {},
    {FactKey("is_open", "washer"): True},
    {FactKey("at", "cup"): "washer"},
    {FactKey("at", "cup"): "washer", FactKey("is_open", "washer"): True},
    {FactKey("at", "cup"): "box", FactKey("is_open", "washer"): True},
    {FactKey("at", "cup"): "box", FactKey("at", "box"): "washer", FactKey("level", "jug"): None},
)


GOALS = [
    *(
        Condition(relation=relation, subject=thing, value=where)
        for thing in ("cup", "jug", "box")
        for relation in ("at", "in")
        for where in ("box", "washer", "table", "kitchen")
    ),
    *(Condition(relation="clean", subject=x, value=v) for x in ("cup", "jug", "box")
      for v in (True, False)),
    *(Condition(relation="reachable", subject=x, value=v) for x in ("cup", "jug", "box")
      for v in (True, False)),
    *(Condition(relation="level", subject="jug", value=v) for v in (0, 1, 2)),
    Condition(relation="is_open", subject="washer", value=False),
    Condition(relation="seen", subject="box", value=True),
    Condition(relation="at", subject="cup", value="washer", any_of=("cup", "jug", "box")),
]  # fmt: skip


def _possible() -> list[Action]:
    found = []
    for skill in SKILLS.values():
        names = (WORLD.of_type(kind) for kind in skill.parameters.values())
        found += [
            skill.ground(dict(zip(skill.parameters, values, strict=True)))
            for values in product(*names)
        ]
    return found


POSSIBLE = _possible()


@st.composite
def kitchen_plans(draw: st.DrawFn) -> tuple[Plan, WorldModel]:
    """A plan whose actors are the robots of `ALLOCATION`, right or a little wrong, and a world.
    Some of the plans keep or avoid something all the time, or until something else has held.
    """
    start = draw(st.sampled_from(STARTS))
    facts: dict[FactKey, Value] = {**WORLD.facts, **start}
    walk: list[Action] = []
    between: list[Mapping[FactKey, Value]] = []
    for _ in range(draw(st.integers(1, 6))):
        ready = [action for action in POSSIBLE if applicable(action, facts, WORLD)]
        skill = draw(st.sampled_from(sorted({action.skill.name for action in ready})))
        walk.append(draw(st.sampled_from([a for a in ready if a.skill.name == skill])))
        between.append(dict(facts))
        facts.update(made_true(walk[-1], facts, WORLD))
    if not draw(st.integers(0, 3)):
        nearly = [a for a in POSSIBLE if first_unmet(a, facts, WORLD) is None]
        walk.append(draw(st.sampled_from(nearly)))
    tasks = list(_lifted(walk, WORLD.with_facts(start)))
    for _ in range(draw(st.integers(0, 2))):
        if tasks:
            _hurt(draw, tasks)
    goal = _goal(draw, facts)
    states = [WORLD.with_facts(start).facts, *between, facts]
    made = Plan(
        plan="p",
        goals=("g",),
        conditions=(goal,),
        tasks=tuple(tasks),
        always=_constraint(draw, states, True),
        never=_constraint(draw, states, False),
        sometime_before=_precedence(draw, states),
    )
    return made, WORLD.with_facts(start)


def _constraint(
    draw: st.DrawFn, states: list[Mapping[FactKey, Value]], wanted: bool
) -> tuple[Condition, ...]:
    """Now and then one condition, mostly one that holds, or does not, all along the walk."""
    if draw(st.integers(0, 3)):
        return ()
    kept = [
        goal
        for goal in GOALS
        if all(condition_holds(facts, goal, WORLD) is wanted for facts in states)
    ]
    return (draw(st.sampled_from(kept if kept and draw(st.integers(0, 3)) else GOALS)),)


def _precedence(draw: st.DrawFn, states: list[Mapping[FactKey, Value]]) -> tuple[Precedence, ...]:
    """Now and then something that comes to hold, mostly after what has to hold before it."""
    if draw(st.integers(0, 3)):
        return ()
    since = {
        goal: next((n for n, facts in enumerate(states) if condition_holds(facts, goal, WORLD)), -1)
        for goal in GOALS
    }
    later = [goal for goal in GOALS if since[goal] > 0]
    then = draw(st.sampled_from(later or GOALS))
    earlier = [goal for goal in GOALS if 0 <= since[goal] < since[then]]
    first = draw(st.sampled_from(earlier if earlier and draw(st.integers(0, 3)) else GOALS))
    return (Precedence(first=first, then=then),)


def _lifted(walk: list[Action], world: WorldModel) -> tuple[Task, ...]:
    tasks, _ = deordered([ActionSequence("g", tuple(walk))], one_actor_each=True, world=world)
    actor_of = {robot: actor for actor, robot in ALLOCATION.items()}
    return tuple(
        replace(
            task,
            actor=actor_of[action.actor],
            args={**action.args, "robot": actor_arg(actor_of[action.actor])},
        )
        for task, action in zip(tasks, walk, strict=True)
    )


def _hurt(draw: st.DrawFn, tasks: list[Task]) -> None:
    """Leave out an edge or a task, add edges, or change an argument."""
    number = draw(st.integers(0, len(tasks) - 1))
    task = tasks[number]
    how = draw(st.sampled_from(["less", "strict", "gone", "argument", "loose"]))
    if how == "less" and task.after:
        tasks[number] = replace(task, after=task.after[1:])
    elif how == "strict":
        tasks[number] = replace(task, after=tuple(t.task for t in tasks[:number]))
    elif how == "loose":
        # Only what one robot does stays in order.
        mine = [t.task for t in tasks[:number] if t.actor == task.actor]
        tasks[number] = replace(task, after=tuple(mine))
    elif how == "argument":
        name = draw(st.sampled_from(sorted(task.args.keys() - {"robot"})))
        choices = WORLD.of_type(SKILLS[task.skill].parameters[name])
        tasks[number] = replace(task, args={**task.args, name: draw(st.sampled_from(choices))})
    elif how == "gone":
        del tasks[number]
        for i, other in enumerate(tasks):
            if task.task in other.after:
                after = (*(t for t in other.after if t != task.task), *task.after)
                tasks[i] = replace(other, after=tuple(dict.fromkeys(after)))


def _goal(draw: st.DrawFn, facts: dict[FactKey, Value]) -> Condition:
    holding = [goal for goal in GOALS if condition_holds(facts, goal, WORLD)]
    return draw(st.sampled_from(holding if draw(st.integers(0, 5)) else GOALS))
