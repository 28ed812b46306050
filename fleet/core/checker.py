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

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from fleet.core.graph import Cycle, TaskGraph
from fleet.core.skills import Action, Literal, Variable
from fleet.core.world_model import WorldModel, condition_holds
from keyexpr_schema.goals import Condition
from keyexpr_schema.ids import ACTOR_PREFIX
from keyexpr_schema.plans import Plan, Task, Violation
from keyexpr_schema.world import NOTHING, Value


@dataclass
class Requirement:
    """What a robot must bring to be an actor: roles to fill, facts that hold of it at the start."""

    roles: list[tuple[Action, str]] = field(default_factory=list)
    facts: dict[str, tuple[Value, str]] = field(default_factory=dict)
    """By relation: the value needed, and the task that needs it first."""
    space: int = 0
    """Room needed in its basket, in objects."""
    pinned_to: str | None = None


@dataclass(frozen=True)
class CheckedPlan:
    """What the checker found; `graph` and `actions` are there once the plan's form is right."""

    violations: tuple[Violation, ...]
    graph: TaskGraph | None = None
    actions: Mapping[str, Action] = field(default_factory=dict)
    requirements: Mapping[str, Requirement] = field(default_factory=dict)

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
    form = _Form(plan, world, allocation)
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
    flow = _Flow(plan, world, graph, form.actions)
    flow.check()
    violations = flow.violations
    for actor, robot in plan.pins.items():
        flow.requirements[ACTOR_PREFIX + actor].pinned_to = robot
    if allocation is None:
        violations.extend(_actors_without_robot(flow.requirements, world))
    else:
        violations.extend(_unable_robots(plan, allocation, form.actions, world))
    return CheckedPlan(tuple(violations), graph, form.actions, dict(flow.requirements))


def eligible(requirement: Requirement, world: WorldModel) -> tuple[dict[str, None], list[str]]:
    """Robots of the team that can be an actor (as an ordered set), and why each other cannot."""
    able: dict[str, None] = {}
    reasons: list[str] = []
    for robot in world.team:
        reason = _why_not(robot, requirement, world)
        if reason is None:
            able[robot] = None
        else:
            reasons.append(reason)
    return able, reasons


def _why_not(robot: str, requirement: Requirement, world: WorldModel) -> str | None:
    if requirement.pinned_to not in (None, robot):
        return f"the plan wants {requirement.pinned_to} and not {robot}"
    for action, parameter in requirement.roles:
        if reason := world.lacks(robot, action, parameter):
            return reason
    for relation, (value, task) in requirement.facts.items():
        has = world.value(relation, robot)
        if (
            has is None
            and relation == "holding"
            and not world.robots[robot].capabilities.get("grip")
        ):
            has = NOTHING  # no hand, so there is nothing in it
        if has != value:
            told = "unknown" if has is None else has
            return f"{task} needs {relation}({robot}) = {value}, and it is {told}"
    if requirement.space:
        room = _capacity(world, robot) - len(_in_basket(world, robot))
        if room < requirement.space:
            return f"{robot}'s basket has room for {room} more and {requirement.space} are needed"
    return None


def _capacity(world: WorldModel, robot: str) -> int:
    return int(world.capability(robot, "basket") or 0)


def _in_basket(world: WorldModel, robot: str) -> list[str]:
    return [
        thing
        for thing in world.objects
        if world.value("at", thing) == robot and world.value("holding", robot) != thing
    ]


def _actors_without_robot(
    requirements: Mapping[str, Requirement], world: WorldModel
) -> Iterable[Violation]:
    for actor, requirement in requirements.items():
        if not actor.startswith(ACTOR_PREFIX):
            continue
        able, reasons = eligible(requirement, world)
        if not able:
            told = "; ".join(dict.fromkeys(reasons)) or "no robot is connected"
            yield Violation(
                code="no-robot",
                sentence=f"no robot can be actor {actor.removeprefix(ACTOR_PREFIX)}: {told}",
            )


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


class _Form:
    """Names, types and arguments: what can be said of each task on its own."""

    def __init__(self, plan: Plan, world: WorldModel, allocation: Mapping[str, str] | None) -> None:
        self.violations: list[Violation] = []
        self.actions: dict[str, Action] = {}
        self._world = world
        self._allocation = allocation
        self._actors = {task.actor for task in plan.tasks}
        for pinned in plan.pins.values():
            if pinned not in world.robots:
                self._say("unknown-name", f"there is no robot {pinned}{_among(world.robots)}", None)
        names = [task.task for task in plan.tasks]
        for name in (
            {name for name in names if names.count(name) > 1}
            if len(set(names)) < len(names)
            else ()
        ):
            self._say("duplicate-task", f"two tasks are called {name}", name)
        known = set(names)
        for task in plan.tasks:
            for before in task.after:
                if before not in known:
                    self._say(
                        "unknown-dependency",
                        f"{task.task} waits for {before}, which is not in the plan",
                        task.task,
                    )
            self._read(task)

    def _say(self, code: str, sentence: str, task: str | None) -> None:
        self.violations.append(Violation(code=code, sentence=sentence, task=task))

    def _read(self, task: Task) -> None:
        skill = self._world.skills.get(task.skill)
        if skill is None:
            self._say(
                "unknown-skill",
                f"{task.task}: there is no skill {task.skill}{_among(self._world.skills)}",
                task.task,
            )
            return
        if set(task.args) != set(skill.parameters):
            self._say(
                "wrong-arguments",
                f"{task.task}: {task.skill} takes {', '.join(skill.parameters)}, "
                f"not {', '.join(task.args) or 'nothing'}",
                task.task,
            )
            return
        if task.args[skill.actor_parameter] != ACTOR_PREFIX + task.actor:
            self._say(
                "wrong-actor",
                f"{task.task}: `{skill.actor_parameter}` must be {ACTOR_PREFIX}{task.actor}, "
                f"the actor that does the task, not {task.args[skill.actor_parameter]}",
                task.task,
            )
            return
        bound: dict[str, str] = {}
        for parameter, kind in skill.parameters.items():
            value = self._bind(task, parameter, kind)
            if value is None:
                return
            bound[parameter] = value
        action = skill.ground(bound)
        if len(set(action.participants)) < len(action.participants):
            self._say(
                "robot-in-two-places",
                f"{task.task}: {task.skill} needs different robots, "
                f"and was given {' and '.join(action.participants)}",
                task.task,
            )
            return
        self.actions[task.task] = action

    def _bind(self, task: Task, parameter: str, kind: str) -> str | None:
        value = task.args[parameter]
        if kind == "robot" and value.startswith(ACTOR_PREFIX):
            actor = value.removeprefix(ACTOR_PREFIX)
            if actor not in self._actors:
                self._say(
                    "unknown-name",
                    f"{task.task}: `{parameter}` names actor {actor}, who has no task"
                    f"{_among(self._actors)}",
                    task.task,
                )
                return None
            if self._allocation is None:
                return value
            robot = self._allocation.get(actor)
            if robot is None or robot not in self._world.robots:
                self._say("unallocated", f"actor {actor} has no robot", task.task)
                return None
            return robot
        found = self._world.kind_of(value)
        if found != kind:
            what = "which nobody knows" if found is None else f"which is a {found}"
            choices = {
                "robot": self._world.robots,
                "object": self._world.objects,
                "place": self._world.places,
            }[kind]
            self._say(
                "unknown-name" if found is None else "wrong-type",
                f"{task.task}: `{parameter}` must be a {kind} and is {value}, {what}"
                f"{_among(choices)}",
                task.task,
            )
            return None
        return value


def _among(names: Iterable[str]) -> str:
    known = sorted(names)
    return f" (there are {', '.join(known)})" if known else " (there are none)"


class _Flow:
    """Conditions and effects over every order that the graph allows."""

    def __init__(
        self, plan: Plan, world: WorldModel, graph: TaskGraph, actions: Mapping[str, Action]
    ) -> None:
        self.violations: list[Violation] = []
        self.requirements: dict[str, Requirement] = defaultdict(Requirement)
        self._plan, self._world, self._graph, self._actions = plan, world, graph, actions
        self._writers: dict[Variable, list[tuple[str, Value]]] = defaultdict(list)
        for task in graph.order:
            for literal in actions[task].after:
                self._writers[literal.variable].append((task, literal.value))
        self._positions = {
            thing: rows
            for thing in world.objects
            if (rows := self._writers.get(Variable("at", thing)))
        }

    def check(self) -> None:
        """Fill `violations` and `requirements`."""
        self._one_task_at_a_time()
        for task in self._graph.order:
            action = self._actions[task]
            for parameter in action.skill.robot_parameters:
                self.requirements[action.args[parameter]].roles.append((action, parameter))
            for literal in action.before:
                self._check_condition(task, literal)
            for carrier in action.space_in:
                self._check_space(task, carrier)
        final = self._final_facts()
        for condition in self._plan.conditions:
            if not condition_holds(final, condition):
                self.violations.append(
                    Violation(
                        code="goal-unmet",
                        sentence=f"{condition} does not hold when the plan is done",
                        condition=condition,
                    )
                )

    def _one_task_at_a_time(self) -> None:
        last: dict[str, str] = {}
        for task in self._graph.order:
            for robot in self._actions[task].participants:
                before = last.get(robot)
                if before is not None and not self._graph.precedes(before, task):
                    self.violations.append(
                        Violation(
                            code="robot-in-two-places",
                            sentence=f"{before} and {task} both need {robot.removeprefix('?')} "
                            "and nothing says which comes first",
                            task=task,
                        )
                    )
                last[robot] = task

    def _check_condition(self, task: str, literal: Literal) -> None:
        graph, variable = self._graph, literal.variable
        rows = [row for row in self._writers.get(variable, ()) if row[0] != task]
        restorers = [w for w, value in rows if value == literal.value and graph.precedes(w, task)]
        for writer, value in rows:
            if value == literal.value or graph.precedes(task, writer):
                continue
            if not any(graph.precedes(writer, restorer) for restorer in restorers):
                verb = "makes" if graph.precedes(writer, task) else "may make"
                self._unmet(
                    "condition-undone",
                    task,
                    literal,
                    f"{task} needs {literal}, and {writer} {verb} it {value} before",
                )
                return
        if not restorers:
            self._check_at_start(task, literal)

    def _check_at_start(self, task: str, literal: Literal) -> None:
        variable = literal.variable
        if variable.subject.startswith(ACTOR_PREFIX):
            facts = self.requirements[variable.subject].facts
            facts.setdefault(variable.relation, (literal.value, task))
            return
        has = self._initial(variable)
        if has != literal.value:
            told = "that is not known" if has is None else f"it is {has}"
            self._unmet(
                "condition-unmet", task, literal, f"{task} needs {literal}, and at the start {told}"
            )

    def _initial(self, variable: Variable) -> Value:
        value = self._world.facts.get(variable)
        if value is None and variable.relation == "holding":
            spec = self._world.robots.get(variable.subject)
            if spec is not None and not spec.capabilities.get("grip"):
                return NOTHING  # no hand, so there is nothing in it
        return value

    def _unmet(self, code: str, task: str, literal: Literal, sentence: str) -> None:
        subject = literal.variable.subject.removeprefix(ACTOR_PREFIX)
        value = literal.value
        if isinstance(value, str):
            value = value.removeprefix(ACTOR_PREFIX)
        self.violations.append(
            Violation(
                code=code,
                sentence=sentence,
                task=task,
                condition=Condition(
                    relation=literal.variable.relation, subject=subject, value=value
                ),
            )
        )

    def _check_space(self, task: str, carrier: str) -> None:
        graph = self._graph
        initial = 0
        planned = 0
        own = {
            literal.variable.subject
            for literal in self._actions[task].after
            if literal.variable.relation == "at" and literal.value == carrier
        }
        for thing in self._world.objects:
            if thing in own:
                continue
            rows = self._positions.get(thing, ())
            if any(
                value == carrier
                and writer != task
                and not graph.precedes(task, writer)
                and not any(
                    other != carrier and graph.precedes(writer, w) and graph.precedes(w, task)
                    for w, other in rows
                )
                for writer, value in rows
            ):
                planned += 1
            elif (
                self._world.value("at", thing) == carrier
                and self._world.value("holding", carrier) != thing
                and not any(graph.precedes(writer, task) for writer, _ in rows)
            ):
                initial += 1
        if carrier.startswith(ACTOR_PREFIX):
            requirement = self.requirements[carrier]
            requirement.space = max(requirement.space, planned + 1)
        elif initial + planned + 1 > _capacity(self._world, carrier):
            self.violations.append(
                Violation(
                    code="no-space",
                    sentence=f"{task} puts an object into {carrier}'s basket, which takes "
                    f"{_capacity(self._world, carrier)} and may hold {initial + planned} by then",
                    task=task,
                )
            )

    def _final_facts(self) -> dict[Variable, Value]:
        """Every variable at the end; unknown where the order of its last writers is open."""
        final: dict[Variable, Value] = dict(self._world.facts)
        for variable, rows in self._writers.items():
            final[variable] = _agreed(
                [
                    value
                    for writer, value in rows
                    if not any(self._graph.precedes(writer, other) for other, _ in rows)
                ]
            )
        for actor, robot in self._plan.pins.items():
            for variable in self._writers:
                if variable.subject == ACTOR_PREFIX + actor:
                    final[Variable(variable.relation, robot)] = final[variable]
        return final


def _agreed(values: Sequence[Value]) -> Value:
    return values[0] if all(value == values[0] for value in values) else None
