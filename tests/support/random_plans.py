"""Random plans that are nearly right, for tests of the checker.

A random walk of actions that can be done, loosened to the order that its causal links ask for, and
then hurt a little or not at all. Drawn so, about half of the plans are good, and the bad ones are
wrong in one place. Plans of independently drawn tasks are nearly always wrong at their first task.
"""

from __future__ import annotations

from itertools import product

from hypothesis import strategies as st
from msgspec.structs import replace

from fleet.core.model.eligibility import lacks
from fleet.core.model.preconditions import first_unmet
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, condition_holds, room_left
from fleet.planners.deordering import ActionSequence, deordered
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Plan, Task
from tests.support.household import PLACES, SKILLS, UNLOAD, at, carrier, cup, fact, manipulator

MOST_TASKS = 6
_MORE = {
    "unload": UNLOAD,
    "fill": {
        "parameters": {"robot": "robot", "object": "object", "place": "place"},
        "before": ["at(robot) = place", "at(object) = place", "full(object) = false"],
        "after": ["full(object) = true"],
    },
    "spill": {
        "parameters": {"robot": "robot", "object": "object"},
        "before": ["holding(robot) = object", "full(object) = true"],
        "after": ["full(object) = false", "wet(object) = unknown"],
    },
}
ALL_SKILLS = {**SKILLS, **skills_from_data({"skills": _MORE}, "here")}
ROBOTS = ("hsr", "r2", "locobot")
ALLOCATION = {f"a{number}": robot for number, robot in enumerate(ROBOTS)}


def world() -> WorldModel:
    """Three rooms, two hands, one basket for one cup; nobody knows where the third cup is."""
    robots = (manipulator("hsr"), manipulator("r2", grip_kg=0.2), carrier("locobot", basket=1))
    robots = tuple(replace(r, skills=(*r.skills, *_MORE)) for r in robots)
    cups = (cup(1), cup(2, mass_kg=0.5), cup(3))
    facts = (
        fact("cup_1", "at", "kitchen"),
        fact("cup_2", "at", "kitchen"),
        fact("hsr", "at", "kitchen"),
        fact("locobot", "at", "hallway"),
        fact("hsr", "holding", "nothing"),
        fact("r2", "holding", "nothing"),
        *(_truth(thing.object, "full", False) for thing in cups),
    )
    return WorldModel.of(ALL_SKILLS, PLACES, cups, robots, facts)


def _truth(subject: str, relation: str, value: bool):  # type: ignore[no-untyped-def]
    return replace(fact(subject, relation, None), value=value)


def _names(model: WorldModel, kind: str) -> tuple[str, ...]:
    return tuple(name for name in model.of_type(kind) if name != "living_room")


def _possible(model: WorldModel) -> list[Action]:
    found = []
    for skill in model.skills.values():
        names = (_names(model, kind) for kind in skill.parameters.values())
        for values in product(*names):
            action = skill.ground(dict(zip(skill.parameters, values, strict=True)))
            apart = len(set(action.participants)) == len(action.participants)
            if apart and not any(
                lacks(model, action.args[p], action, p) for p in skill.robot_parameters
            ):
                found.append(action)
    return found


WORLD = world()
POSSIBLE = _possible(WORLD)
STARTS: tuple[dict[FactKey, Value], ...] = (
    {},
    {  # a cup in the hand, and a basket beside it
        FactKey("at", "hsr"): "hallway",
        FactKey("holding", "hsr"): "cup_1",
        FactKey("at", "cup_1"): "hsr",
    },
    {  # the same, and the basket is full
        FactKey("at", "hsr"): "hallway",
        FactKey("holding", "hsr"): "cup_1",
        FactKey("at", "cup_1"): "hsr",
        FactKey("at", "cup_2"): "locobot",
    },
    {  # a full basket, and an empty hand beside it
        FactKey("at", "hsr"): "hallway",
        FactKey("at", "cup_2"): "locobot",
        FactKey("full", "cup_2"): True,
    },
)


def doable(action: Action, facts: dict[FactKey, Value]) -> bool:
    """Whether the action can be done in these facts."""
    return first_unmet(action, facts, WORLD) is None and all(
        room_left(robot, facts, WORLD) > 0 for robot in action.space_in
    )


@st.composite
def plans(draw: st.DrawFn) -> tuple[Plan, WorldModel]:
    """A plan whose actors are the robots of `ALLOCATION`, right or a little wrong, and a world."""
    start = draw(st.sampled_from(STARTS))
    facts: dict[FactKey, Value] = {**WORLD.facts, **start}
    walk: list[Action] = []
    for _ in range(draw(st.integers(1, MOST_TASKS))):
        ready = [action for action in POSSIBLE if doable(action, facts)]
        # By skill first: most of what can be done is driving.
        skill = draw(st.sampled_from(sorted({action.skill.name for action in ready})))
        action = draw(st.sampled_from([a for a in ready if a.skill.name == skill]))
        walk.append(action)
        facts.update({literal.variable: literal.value for literal in action.after})
    if not draw(st.integers(0, 3)):
        # Which can hardly be done now; if so, for want of room.
        crowded = [a for a in POSSIBLE if a.space_in and first_unmet(a, facts, WORLD) is None]
        walk.append(draw(st.sampled_from(crowded or POSSIBLE)))
    tasks = list(_lifted(walk))
    for _ in range(draw(st.integers(0, 2))):
        if tasks:
            _hurt(draw, tasks)
    tasks = [_named(task, {t.actor for t in tasks}) for task in tasks]
    goal = _goal(draw, facts)
    # Where a cup rides along from the start, the plan has to say whom it rides with.
    riding = [start.get(FactKey("at", subject)) for subject in goal.subjects]
    pins = {
        actor: robot
        for actor, robot in ALLOCATION.items()
        if robot in (*goal.subjects, goal.value, *riding) and any(t.actor == actor for t in tasks)
    }
    made = Plan(plan="p", goals=("g",), conditions=(goal,), tasks=tuple(tasks), pins=pins)
    return made, WORLD.with_facts(start)


def _lifted(walk: list[Action]) -> tuple[Task, ...]:
    """Tasks of the actors of `ALLOCATION`, in the order that matters."""
    tasks, _ = deordered([ActionSequence("g", tuple(walk))], one_actor_each=True)
    actor_of = {robot: actor for actor, robot in ALLOCATION.items()}
    return tuple(
        replace(
            task,
            actor=actor_of[action.actor],
            args={
                name: actor_arg(actor_of[value]) if value in actor_of else value
                for name, value in action.args.items()
            },
        )
        for task, action in zip(tasks, walk, strict=True)
    )


def _named(task: Task, busy: set[str]) -> Task:
    """The same; who takes part and does nothing itself is no actor, and goes by name."""
    names = {actor_arg(actor): robot for actor, robot in ALLOCATION.items() if actor not in busy}
    return replace(task, args={name: names.get(value, value) for name, value in task.args.items()})


def _hurt(draw: st.DrawFn, tasks: list[Task]) -> None:
    """Change one thing: an edge, an argument, or a task that is left out."""
    number = draw(st.integers(0, len(tasks) - 1))
    task = tasks[number]
    how = draw(st.sampled_from(["less", "more", "argument", "gone", "strict"]))
    if how == "less" and task.after:
        tasks[number] = replace(task, after=tuple(t for t in task.after[1:]))
    elif how == "more" and number:
        before = draw(st.sampled_from(tasks[:number])).task
        tasks[number] = replace(task, after=tuple(dict.fromkeys((*task.after, before))))
    elif how == "strict" and number:
        tasks[number] = replace(task, after=tuple(t.task for t in tasks[:number]))
    elif how == "argument":
        name = draw(st.sampled_from(sorted(set(task.args) - {"robot"}) or ["robot"]))
        kind = ALL_SKILLS[task.skill].parameters[name]
        choices = _names(WORLD, kind)
        if kind != "robot" and choices:
            tasks[number] = replace(task, args={**task.args, name: draw(st.sampled_from(choices))})
    elif how == "gone":
        del tasks[number]
        # Who waited for it waits for what it waited for, so that the order stays as it was.
        for i, other in enumerate(tasks):
            after = [t for t in other.after if t != task.task]
            if len(after) < len(other.after):
                tasks[i] = replace(other, after=tuple(dict.fromkeys((*after, *task.after))))


def _goal(draw: st.DrawFn, facts: dict[FactKey, Value]) -> Condition:
    """Mostly one that holds after the walk, of all forms that there are."""
    goals = [
        *(at(c, place) for c in WORLD.objects for place in ("kitchen", "hallway", "locobot")),
        *(Condition(relation="held", subject=c, value=True) for c in WORLD.objects),
        *(Condition(relation="located", subject=c, value=True) for c in WORLD.objects),
        *(Condition(relation="full", subject=c, value=True) for c in WORLD.objects),
        Condition(relation="at", subject="cup_1", value="hallway", any_of=("cup_1", "cup_2")),
        Condition(relation="at", subject="hsr", value="hallway"),
    ]
    holding = [goal for goal in goals if condition_holds(facts, goal, WORLD)]
    return draw(st.sampled_from(holding if draw(st.integers(0, 5)) else goals))
