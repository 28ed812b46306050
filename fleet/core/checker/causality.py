"""Causality: whether conditions hold before tasks and at the end, in every order of the graph.

The criterion is that of `fleet.core.checker.plan_checker`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from fleet.core.checker.actor_requirements import Requirement
from fleet.core.checker.quantities import BasketLoads
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, capacity, condition_holds, known_value
from keyexpr_schema.facts import FactKey, Literal, Value, render_value
from keyexpr_schema.ids import actor_arg, actor_in, bare_name
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Plan, Violation


class Causality:
    """Checks preconditions, goals and room of one plan, on construction.

    `violations` are what is wrong, `requirements` what actors (`?a1`) need of their robots.
    """

    def __init__(
        self, plan: Plan, world: WorldModel, graph: TaskGraph, actions: Mapping[str, Action]
    ) -> None:
        self.violations: list[Violation] = []
        self.requirements: dict[str, Requirement] = defaultdict(Requirement)
        self._plan, self._world, self._graph, self._actions = plan, world, graph, actions
        self._writers: dict[FactKey, list[tuple[str, Value]]] = defaultdict(list)
        for task in graph.order:
            for literal in actions[task].after:
                self._writers[literal.variable].append((task, literal.value))
        self._written: dict[FactKey, tuple[int, dict[Value, int]]] = {}
        self._baskets = BasketLoads(world, graph, self._writers)
        self._check()

    def _check(self) -> None:
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
                sentence = f"{condition} does not hold when the plan is done"
                self._report("goal-unmet", sentence, condition=condition)

    def _report(
        self, code: str, sentence: str, task: str | None = None, condition: Condition | None = None
    ) -> None:
        self.violations.append(
            Violation(code=code, sentence=sentence, task=task, condition=condition)
        )

    def _one_task_at_a_time(self) -> None:
        last: dict[str, str] = {}
        for task in self._graph.order:
            for robot in self._actions[task].participants:
                before = last.get(robot)
                if before is not None and not self._graph.precedes(before, task):
                    sentence = (
                        f"{before} and {task} both need {bare_name(robot)} "
                        "and nothing says which comes first"
                    )
                    self._report("robot-in-two-places", sentence, task)
                last[robot] = task

    def _check_condition(self, task: str, literal: Literal) -> None:
        graph, variable = self._graph, literal.variable
        all_writers, by_value = self._masks(variable)
        same = by_value.get(literal.value, 0)
        restorers = graph.last_before(task, same)
        others = all_writers & ~same
        for restorer in restorers:
            others &= ~graph.before(restorer)
        writer = graph.first_not_after(task, others)
        if writer is not None:
            value = next(v for v, mask in by_value.items() if graph.mask((writer,)) & mask)
            verb = "makes" if graph.precedes(writer, task) else "may make"
            undone = f"{writer} {verb} it {render_value(value)} before"
            self._unmet("condition-undone", task, literal, undone)
        elif not restorers:
            self._check_at_start(task, literal)

    def _masks(self, variable: FactKey) -> tuple[int, dict[Value, int]]:
        """The tasks that write a variable, as a bit set, and those that write each value."""
        if variable not in self._written:
            by_value: dict[Value, int] = {}
            for task, value in dict(self._writers.get(variable, ())).items():
                by_value[value] = by_value.get(value, 0) | self._graph.mask((task,))
            every = 0
            for mask in by_value.values():
                every |= mask
            self._written[variable] = every, by_value
        return self._written[variable]

    def _check_at_start(self, task: str, literal: Literal) -> None:
        variable = literal.variable
        if actor_in(variable.subject) is not None:
            facts = self.requirements[variable.subject].facts
            facts.setdefault(variable.relation, (literal.value, task))
            return
        has = known_value(variable, self._world.facts, self._world)
        wanted = literal.value
        if actor_in(wanted) is not None and has in self._world.robots:
            # Who has it must be the actor: something is taken out of a basket, or back.
            self.requirements[str(wanted)].valued.setdefault(variable, task)
        elif has != wanted:
            state = "that is not known" if has is None else f"it is {has}"
            self._unmet("condition-unmet", task, literal, f"at the start {state}")

    def _unmet(self, code: str, task: str, literal: Literal, why: str) -> None:
        (relation, subject), value = literal
        value = bare_name(value) if isinstance(value, str) else value
        condition = Condition(relation=relation, subject=bare_name(subject), value=value)
        self._report(code, f"{task} needs {literal}, and {why}", task, condition)

    def _check_space(self, task: str, carrier: str) -> None:
        at_start, planned = self._baskets.before(task, self._actions[task], carrier)
        if actor_in(carrier) is not None:
            requirement = self.requirements[carrier]
            freed = sum(self._baskets.unloaded_before(task, row) for row in requirement.valued)
            requirement.space = max(requirement.space, planned + 1 - freed)
        elif at_start + planned + 1 > (room := capacity(carrier, self._world)):
            sentence = (
                f"{task} puts an object into {carrier}'s basket, which takes "
                f"{room} and may hold {at_start + planned} by then"
            )
            self._report("no-space", sentence, task)

    def _final_facts(self) -> dict[FactKey, Value]:
        """Every variable at the end; unknown where the order of its last writers is open."""
        final: dict[FactKey, Value] = dict(self._world.facts)
        # What is required of an actor at the start holds of the robot that will be it.
        for actor, requirement in self.requirements.items():
            for relation, (value, _) in requirement.facts.items():
                final[FactKey(relation, actor)] = value
        for variable, rows in self._writers.items():
            written = dict(rows)
            last = {written[task] for task in self._graph.last_of(self._masks(variable)[0])}
            final[variable] = last.pop() if len(last) == 1 else None
        pinned = {actor_arg(actor): robot for actor, robot in self._plan.pins.items()}
        for variable in self._writers:
            value = final[variable]
            if isinstance(value, str) and value in pinned:
                value = final[variable] = pinned[value]
            if variable.subject in pinned:
                final[FactKey(variable.relation, pinned[variable.subject])] = value
        return final
