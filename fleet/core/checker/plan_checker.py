"""The plan checker: every plan passes through it, whoever made it, and `CheckedPlan` is the proof.

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

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import ClassVar

import msgspec

from fleet.core.checker.actor_requirements import Candidates, Left, Requirement
from fleet.core.checker.causality import Causality
from fleet.core.checker.well_formedness import PlanForm
from fleet.core.model.eligibility import lacks
from fleet.core.model.formulas.effects import instances
from fleet.core.model.shortfall import told_together
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import Cycle, TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg, actor_in
from keyexpr_schema.payloads.plans import Making, Plan, Task, Violation


@dataclass(frozen=True)
class CheckedPlan:
    """A plan that is valid in `world`, with what its check found; `check_plan` alone makes one.

    `actions` are by task. By actor, `requirements` say what it needs of its robot, and `able` which
    robots of the team can be it.
    """

    plan: Plan
    world: WorldModel
    graph: TaskGraph
    actions: Mapping[str, Action]
    requirements: Mapping[str, Requirement]
    able: Mapping[str, tuple[str, ...]]
    violations: ClassVar[tuple[Violation, ...]] = ()

    @cached_property
    def effects(self) -> Mapping[FactKey, Value]:
        """What tasks make of each variable in any case; of several, the last in the graph's order.
        What depends on something is not in it: who may still have a load is told by it, and the
        check of the allocated plan does not need it."""
        return _effects(self.graph, self.actions)

    def with_making(self, making: Making, strategy: str) -> CheckedPlan:
        """The same plan, saying how it was made; no check depends on that."""
        return replace(
            self, plan=msgspec.structs.replace(self.plan, making=making, strategy=strategy)
        )


@dataclass(frozen=True)
class InvalidPlan:
    """Why a plan is not valid in `world`; `violations` has at least one reason.

    `graph`, `actions` and `able` are there if the plan's form is right; see `CheckedPlan`.
    """

    plan: Plan
    world: WorldModel
    violations: tuple[Violation, ...]
    graph: TaskGraph | None = None
    actions: Mapping[str, Action] = field(default_factory=dict)
    able: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def effects(self) -> Mapping[FactKey, Value]:
        """As those of a `CheckedPlan`."""
        return {} if self.graph is None else _effects(self.graph, self.actions)


def check_plan(plan: Plan, world: WorldModel) -> CheckedPlan | InvalidPlan:
    """Check a plan whose robots are still actors."""
    read = _read(plan, world)
    if isinstance(read, InvalidPlan):
        return read
    graph, actions = read
    causality = Causality(plan, world, graph, actions)
    for pinned, robot in plan.pins.items():
        causality.requirements[actor_arg(pinned)].pinned_to = robot
    for _, robots, participants in _by_certain_robots(plan, actions):
        for participant in participants:
            required = causality.requirements[participant]
            required.among = robots if required.among is None else robots & required.among
    requirements = {
        actor: each
        for name, each in causality.requirements.items()
        if (actor := actor_in(name)) is not None
    }
    candidates = Candidates(requirements, _leaves(graph, actions, world), world)
    violations = (*causality.violations, *_actors_without_robot(candidates))
    able = {actor: candidates.able[actor] for actor in plan.actors}
    if violations:
        return InvalidPlan(plan, world, violations, graph, actions, able)
    return CheckedPlan(plan, world, graph, actions, requirements, able)


def check_allocation(
    plan: Plan,
    world: WorldModel,
    allocation: Mapping[str, str],
    extra_after: Mapping[str, Iterable[str]] | None = None,
) -> tuple[Violation, ...]:
    """The violations of a plan with actors bound to robots; none if it is valid.

    `extra_after` adds dependencies: task to tasks that it also waits for.
    """
    read = _read(plan, world, allocation, extra_after or {})
    if isinstance(read, InvalidPlan):
        return read.violations
    graph, actions = read
    causality = Causality(plan, world, graph, actions)
    return (*causality.violations, *_unable_robots(plan, allocation, actions, world))


def _read(
    plan: Plan,
    world: WorldModel,
    allocation: Mapping[str, str] | None = None,
    extra_after: Mapping[str, Iterable[str]] = {},
) -> tuple[TaskGraph, dict[str, Action]] | InvalidPlan:
    """The plan's graph and ground actions, if its form is right."""
    form = PlanForm(plan, world, allocation)
    if form.violations:
        return InvalidPlan(plan, world, tuple(form.violations))
    after = {task.task: {*task.after, *extra_after.get(task.task, ())} for task in plan.tasks}
    try:
        return TaskGraph(after), form.actions
    except Cycle as cycle:
        sentence = f"tasks {', '.join(cycle.tasks)} wait for each other in a circle"
        violation = Violation(code="cycle", sentence=sentence, task=cycle.tasks[0])
        return InvalidPlan(plan, world, (violation,))


def _effects(graph: TaskGraph, actions: Mapping[str, Action]) -> dict[FactKey, Value]:
    return {key: value for task in graph.order for key, value in actions[task].after}


def _leaves(
    graph: TaskGraph, actions: Mapping[str, Action], world: WorldModel
) -> dict[str, set[Left]]:
    """What each actor leaves of its robot, or may: its tasks have an order, and the last one holds;
    what depends on something may be so. Numbers that are added up are not among it."""
    leaves: dict[str, set[Left]] = defaultdict(set)
    conditional = (
        (row.variable, row.value)
        for action in actions.values()
        for effect in action.conditional
        for row in instances(effect, world)
        if row.to is None
    )
    for (relation, subject), value in chain(_effects(graph, actions).items(), conditional):
        if (actor := actor_in(subject)) is not None:
            leaves[actor].add((relation, value))
    return leaves


def _actors_without_robot(candidates: Candidates) -> Iterable[Violation]:
    for actor, able in candidates.able.items():
        if not able:
            reasons = "; ".join(told_together(candidates.reasons(actor)))
            sentence = f"no robot can be actor {actor}: {reasons or 'no robot is connected'}"
            yield Violation(code="no-robot", sentence=sentence)


def _by_certain_robots(
    plan: Plan, actions: Mapping[str, Action]
) -> Iterable[tuple[Task, frozenset[str], tuple[str, ...]]]:
    """Tasks of goals that certain robots shall do, those robots, and who takes part."""
    for task in plan.tasks:
        if task.goal is not None and task.goal in plan.by:
            yield task, frozenset(plan.by[task.goal]), actions[task.task].participants


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
            if reason := lacks(world, action.args[parameter], action, parameter):
                yield Violation(code="no-robot", sentence=f"{task}: {reason}", task=task)
    for one, robots, participants in _by_certain_robots(plan, actions):
        for robot in participants:
            if robot not in robots:
                names = " or ".join(sorted(robots))
                sentence = f"{one.task} is for goal {one.goal}, which {names} shall do, not {robot}"
                yield Violation(code="no-robot", sentence=sentence, task=one.task)
