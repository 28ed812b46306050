"""Work that a plan does again for each condition, and could do once for all of them."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.durations import only_moves
from fleet.core.model.formulas.effects import instances
from fleet.core.model.formulas.evaluation import conjuncts
from fleet.core.model.formulas.nodes import Holds
from fleet.core.model.skills import Action
from fleet.core.model.world import room_left
from fleet.planners.base import PlanningProblem
from fleet.planners.symbolic.action_sequences import Subgoal
from keyexpr_schema.facts import AT, IN, ON, Literal
from keyexpr_schema.payloads.goals import Condition


def done_again(made: CheckedPlan) -> tuple[Action, ...]:
    """What several tasks of a plan do, whoever does them; drives do not count."""
    rows: dict[object, list[Action]] = defaultdict(list)
    for task in made.plan.tasks:
        skill = made.world.skills.get(task.skill)
        if skill is not None and not only_moves(skill):
            args = (v for p, v in task.args.items() if p not in skill.robot_parameters)
            rows[task.skill, *args].append(skill.ground(task.args))
    return tuple(found[0] for found in rows.values() if len(found) > 1)


def needed_for_all(problem: PlanningProblem, again: tuple[Action, ...]) -> tuple[Subgoal, ...]:
    """What must hold so that doing it once is enough for all conditions of goals that it makes
    true: that every dish is in the machine. No more than there is room for."""
    world = problem.world
    wanted = {
        literal: goal.goal
        for goal in problem.goals
        for condition in goal.conditions
        if len(condition.subjects) == 1 and not world.holds(condition)
        for literal in condition.literals
    }
    found: dict[Subgoal, None] = {}
    room: Counter[object] = Counter()
    for action in again:
        for goal, literal in _guards(action, wanted, problem):
            (relation, subject), value = literal
            condition = Condition(relation=relation, subject=subject, value=value)
            if world.holds(condition) or Subgoal(goal, condition) in found:
                continue
            if relation in (ON, IN, AT) and value in world.objects:
                if room[value] >= room_left(str(value), world.facts, world):
                    continue
                room[value] += 1
            found[Subgoal(goal, condition)] = None
    return tuple(found)


def _guards(
    action: Action, wanted: dict[Literal, str], problem: PlanningProblem
) -> Iterator[tuple[str, Literal]]:
    """What an action's conditional effects depend on, where they make true what is wanted."""
    for effect in action.conditional:
        for row in instances(effect, problem.world):
            goal = wanted.get(Literal(row.variable, row.value))
            if row.to is not None or goal is None:
                continue
            for part in conjuncts(row.when):
                if isinstance(part, Holds):
                    yield goal, part.literal


def loads_what_moves(problem: PlanningProblem) -> bool:
    """Whether a goal is about where something is, and about what is on or in it."""
    return any(
        on.relation in (ON, IN) and at.relation == AT and on.value in at.subjects
        for goal in problem.goals
        for on in goal.conditions
        for at in goal.conditions
    )
