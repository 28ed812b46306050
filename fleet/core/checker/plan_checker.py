"""The plan checker: every plan passes through it, whoever made it.

It is exact for the conditions it knows: a plan passes if and only if every precondition of every
task holds in every order that the DAG allows. For ground plans that is decided variable by
variable (the modal truth criterion, Chapman 1987): a condition holds before a task if something
necessarily before it establishes it and every task that could undo it comes later, or is followed,
still before the task, by one that restores it. Counts (room in a basket) are checked against the
worst order.

Robots are actors until the plan is allocated. What an actor's first tasks need of it and nothing
in the plan provides (an empty hand, a cup already in it) becomes a *requirement* on the robot that
will be it. The same check on the allocated plan takes robots for actors.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from fleet.core.checker.actor_requirements import Candidates, Left, Requirement
from fleet.core.checker.causality import PlanFlow
from fleet.core.checker.form import PlanForm
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import Cycle, TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import Value
from keyexpr_schema.ids import actor_arg, actor_in
from keyexpr_schema.payloads.plans import Plan, Violation


@dataclass(frozen=True)
class CheckedPlan:
    """What the checker found; `graph` and `actions` are there once the plan's form is right.

    `able` has the robots that can be each actor, unless an allocation was checked.
    """

    violations: tuple[Violation, ...]
    graph: TaskGraph | None = None
    actions: Mapping[str, Action] = field(default_factory=dict)
    requirements: Mapping[str, Requirement] = field(default_factory=dict)
    able: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against the plan."""
        return not self.violations


def check_plan(
    plan: Plan,
    world: WorldModel,
    allocation: Mapping[str, str] | None = None,
    extra_after: Mapping[str, Iterable[str]] | None = None,
) -> CheckedPlan:
    """Check `plan` against `world`, with actors bound to robots if an `allocation` is given.

    `extra_after` adds dependencies: task to tasks that it also waits for.
    """
    form = PlanForm(plan, world, allocation)
    if form.violations:
        return CheckedPlan(tuple(form.violations))
    after = {
        task.task: {*task.after, *(extra_after or {}).get(task.task, ())} for task in plan.tasks
    }
    try:
        graph = TaskGraph(after)
    except Cycle as cycle:
        return CheckedPlan(
            (
                Violation(
                    code="cycle",
                    sentence=f"tasks {', '.join(cycle.tasks)} wait for each other in a circle",
                    task=cycle.tasks[0],
                ),
            )
        )
    flow = PlanFlow(plan, world, graph, form.actions)
    flow.check()
    violations = flow.violations
    for pinned, robot in plan.pins.items():
        flow.requirements[actor_arg(pinned)].pinned_to = robot
    able: Mapping[str, tuple[str, ...]] = {}
    if allocation is None:
        requirements = {
            actor: each
            for name, each in flow.requirements.items()
            if (actor := actor_in(name)) is not None
        }
        candidates = Candidates(requirements, _leaves(graph, form.actions), world)
        violations.extend(_actors_without_robot(candidates))
        able = candidates.able
    else:
        violations.extend(_unable_robots(plan, allocation, form.actions, world))
    return CheckedPlan(tuple(violations), graph, form.actions, dict(flow.requirements), able)


def _leaves(graph: TaskGraph, actions: Mapping[str, Action]) -> dict[str, frozenset[Left]]:
    """What each actor leaves of its robot: its tasks have an order, and the last one holds."""
    last: dict[str, dict[str, Value]] = {}
    for task in graph.order:
        for variable, value in actions[task].after:
            if (actor := actor_in(variable.subject)) is not None:
                last.setdefault(actor, {})[variable.relation] = value
    return {actor: frozenset(rows.items()) for actor, rows in last.items()}


def _actors_without_robot(candidates: Candidates) -> Iterable[Violation]:
    for actor, able in candidates.able.items():
        if not able:
            reasons = dict.fromkeys(candidates.reasons(actor))
            told = "; ".join(reasons) or "no robot is connected"
            yield Violation(code="no-robot", sentence=f"no robot can be actor {actor}: {told}")


def _unable_robots(
    plan: Plan, allocation: Mapping[str, str], actions: Mapping[str, Action], world: WorldModel
) -> Iterable[Violation]:
    for actor, robot in plan.pins.items():
        if allocation.get(actor) != robot:
            yield Violation(
                code="no-robot",
                sentence=f"actor {actor} must be {robot}, and is {allocation.get(actor)}",
            )
    for task, action in actions.items():
        for parameter in action.skill.robot_parameters:
            if reason := world.lacks(action.args[parameter], action, parameter):
                yield Violation(code="no-robot", sentence=f"{task}: {reason}", task=task)
