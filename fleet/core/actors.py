"""Actor constraints and actor order: which actors must be different robots, which come first or
last on theirs; tasks that nobody can do, and a quick allocation.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan
from fleet.core.model.eligibility import lacks
from fleet.core.model.shortfall import told_together
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg, actor_in, bare_name
from keyexpr_schema.payloads.plans import Plan, Violation

Pair = tuple[str, str]


def carried_at_end(checked: CheckedPlan | InvalidPlan) -> dict[str, str]:
    """Objects that the plan leaves with an actor, in its basket or hand, and which actor.

    Such actors come last: their robot would carry the object off.
    """
    return {
        key.subject: actor
        for key, value in checked.effects.items()
        if key.relation == AT and (actor := actor_in(value)) is not None
    }


def first_actors(checked: CheckedPlan) -> frozenset[str]:
    """Actors that need their robot as it is now, and as some other actor would not leave it."""
    last = {actor_arg(actor) for actor in carried_at_end(checked).values()}
    left: dict[str, set[Value]] = defaultdict(set)
    for (relation, subject), value in checked.effects.items():
        if subject not in last:
            left[relation].add(value)
    return frozenset(
        actor
        for actor, requirement in checked.requirements.items()
        if any(left[relation] - {value} for relation, (value, _) in requirement.facts.items())
    )


def actors_apart(checked: CheckedPlan) -> frozenset[Pair]:
    """Pairs of actors that must be different robots, each pair in order of name.

    Those that meet in one task; and those that both still have a load when the plan is done: a
    robot on its way to a second delivery would carry the first one off.
    """
    apart: set[Pair] = set()
    for action in checked.actions.values():
        actors = sorted(bare_name(name) for name in action.participants)
        apart.update((a, b) for i, a in enumerate(actors) for b in actors[i + 1 :])
    loaded = sorted(set(carried_at_end(checked).values()))
    pins = checked.plan.pins
    apart.update(
        (a, b)
        for i, a in enumerate(loaded)
        for b in loaded[i + 1 :]
        # Two that must be the same robot cannot be kept apart; the checker of the allocated plan
        # sees whether one load is carried off with the other.
        if a not in pins or pins[a] != pins.get(b)
    )
    return frozenset(apart)


def tasks_nobody_can_do(invalid: InvalidPlan) -> tuple[Violation, ...]:
    """Tasks with a part that no connected robot can take, each with what is lacking.

    None if the plan's form is wrong.
    """
    world = invalid.world
    violations = []
    for task in invalid.plan.tasks if invalid.actions else ():
        action = invalid.actions[task.task]
        for parameter in action.skill.robot_parameters:
            unable = [lacks(world, robot, action, parameter) for robot in world.team]
            if all(unable):
                reasons = "; ".join(told_together(filter(None, unable))) or "no robot is connected"
                role = "" if parameter == action.skill.actor_parameter else f" (as its {parameter})"
                violations.append(
                    Violation(
                        code="no-robot",
                        sentence=f"no robot can do task {task.task}, {task.skill}{role}: {reasons}",
                        task=task.task,
                    )
                )
    return tuple(violations)


def task_counts(plan: Plan) -> dict[str, int]:
    """The number of tasks of each actor."""
    counts = dict.fromkeys(plan.actors, 0)
    for task in plan.tasks:
        counts[task.actor] += 1
    return counts


def least_loaded(checked: CheckedPlan) -> Mapping[str, str] | None:
    """Each actor in turn to the able robot with the fewest tasks so far; `None` if one is left.

    Actors with the fewest choices come first.
    """
    able, apart, counts = checked.able, actors_apart(checked), task_counts(checked.plan)
    load = dict.fromkeys(checked.world.team, 0)
    allocation: dict[str, str] = {}
    for actor in sorted(able, key=lambda name: len(able[name])):
        taken = {
            allocation.get(two if one == actor else one)
            for one, two in apart
            if actor in (one, two)
        }
        free = [robot for robot in able[actor] if robot not in taken]
        if not free:
            return None
        robot = min(free, key=lambda name: load[name])
        allocation[actor] = robot
        load[robot] += counts[actor]
    return allocation
