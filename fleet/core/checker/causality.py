"""Causality: whether conditions hold before tasks and at the end, in every order of the graph.

The criterion is that of `fleet.core.checker.plan_checker`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from functools import cached_property

from fleet.core.checker.actor_requirements import Asked, Requirement
from fleet.core.checker.plan_goals import PlanGoals
from fleet.core.checker.quantities import BasketLoads
from fleet.core.checker.reachable_states import ReachableStates, Undecided, listed
from fleet.core.checker.writers import Writers
from fleet.core.model.derived import holds, read_by
from fleet.core.model.formulas.evaluation import conjuncts, expanded
from fleet.core.model.formulas.nodes import (
    TRUE,
    And,
    Compare,
    Constant,
    Formula,
    Holds,
    Not,
    Stored,
    Sum,
    Total,
)
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, capacity, known_value
from keyexpr_schema.facts import AT, HOLDING, FactKey, Literal, Value, render_value
from keyexpr_schema.ids import actor_in, bare_name
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
        self._writers = Writers(graph, actions, world)
        self._baskets = BasketLoads(world, graph, self._writers.plain)
        self._unbound = any(
            actor_in(name) is not None for a in actions.values() for name in a.participants
        )
        self._moved_by_chance = any(
            self._writers.guarded_mask(FactKey(AT, thing)) for thing in world.objects
        )
        self._too_full: set[str] = set()
        self._states = ReachableStates(graph, self._writers, world, self._at_start)
        self._check()

    def _check(self) -> None:
        self._one_task_at_a_time()
        for task in self._graph.order:
            action = self._actions[task]
            for parameter in action.skill.robot_parameters:
                self.requirements[action.args[parameter]].roles.append((action, parameter))
            self.requirements[action.actor].tasks.append((task, action))
            for literal in action.before:
                if self._is_plain(literal):
                    self._check_condition(task, literal)
        # What actors need of their robots is known now, and is what formulas begin with.
        for task in self._graph.order:
            action = self._actions[task]
            for literal in action.before:
                if not self._is_plain(literal):
                    self._check_formula(task, Holds(literal))
            for formula in action.conditions:
                self._check_formula(task, formula)
            for carrier in action.space_in:
                self._check_space(task, carrier)
        goals = PlanGoals(self._plan, self._world, self._graph, self._writers, self._states)
        self.violations += goals.violations(self.requirements if self._unbound else None)

    def _is_plain(self, literal: Literal) -> bool:
        """Whether it depends on its own variable alone, and on tasks that write it in any case."""
        variable = literal.variable
        if self._writers.guarded_mask(variable):
            return False
        return read_by(literal, self._values_of, self._world) == {variable}

    def _values_of(self, variable: FactKey) -> set[Value]:
        values = self._writers.values(variable)
        return values | {known_value(variable, self._world.facts, self._world)}

    def _at_start(self, variable: FactKey) -> Value:
        """The value before the plan, as far as it does not depend on which robots actors will be.

        Raises:
            Undecided: it does.
        """
        if actor_in(variable.subject) is not None:
            needed = self.requirements.get(variable.subject)
            if needed is None or variable.relation not in needed.facts:
                raise Undecided
            return needed.facts[variable.relation][0]
        value = known_value(variable, self._world.facts, self._world)
        if self._unbound and (
            variable.subject in self._world.robots or value in self._world.robots
        ):
            raise Undecided
        return value

    def _holds(self, literal: Literal, value: Value) -> bool:
        """Whether a plain literal holds where its variable has that value."""
        return value == literal.value or (
            literal.variable.relation == AT
            and holds(literal, lambda v: value if v == literal.variable else None, self._world)
        )

    def _check_formula(self, task: str, formula: Formula, what: str | None = None) -> None:
        try:
            failure = self._states.failure(formula, task)
        except Undecided:
            self._ask_of_robot(task, formula)
            return
        if failure is None:
            return
        needs = f"{task} needs {what or formula_text(failure.part)}"
        names = listed(failure.after)
        if failure.open:
            code, why = (
                "too-many-orders",
                (
                    "whether that holds depends on the order of too many tasks: "
                    f"say which of {names} come first"
                ),
            )
        elif failure.after:
            code, why = "condition-undone", f"that need not hold after {names}"
        else:
            code, why = "condition-unmet", "that does not hold at the start"
        condition = None
        if isinstance(failure.part, Holds):
            (relation, subject), value = failure.part.literal
            value = bare_name(value) if isinstance(value, str) else value
            condition = Condition(relation=relation, subject=bare_name(subject), value=value)
        self._report(code, f"{needs}, and {why}", task, condition)

    def _ask_of_robot(self, task: str, formula: Formula) -> None:
        """What a formula says of one actor, and no other actor changes, its robot decides."""
        for part in conjuncts(expanded(formula, self._world)):
            try:
                read = self._states.read_for(part)
            except Undecided:
                continue
            actors = {key.subject for key in read if actor_in(key.subject) is not None}
            if len(actors) != 1:
                continue
            (actor,) = actors
            others = self._changers
            if all(others[key.relation] <= {actor} for key in read if key.subject == actor):
                of_actor = sorted(key.relation for key in read if key.subject == actor)
                asked = Asked(part, task, actor, tuple(of_actor), self._holds_for)
                self.requirements[actor].asked.append(asked)

    @cached_property
    def _changers(self) -> Mapping[str, set[str]]:
        """By relation, the actors of which some task changes it: two may be the same robot."""
        found: dict[str, set[str]] = defaultdict(set)
        for key in self._writers.variables:
            if actor_in(key.subject) is not None:
                found[key.relation].add(key.subject)
        return found

    def _holds_for(self, asked: Asked, values: Mapping[str, Value]) -> bool:
        """Whether it does in every order, with these values of the actor's variables at first."""

        def start(variable: FactKey) -> Value:
            needed = self.requirements[asked.actor].facts
            if variable.subject != asked.actor or variable.relation in needed:
                return self._at_start(variable)
            return values[variable.relation]

        states = ReachableStates(self._graph, self._writers, self._world, start)
        try:
            return states.failure(asked.formula, asked.task) is None
        except Undecided:
            return True

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
        every = same = 0
        for value, mask in self._writers.by_value(variable).items():
            every |= mask
            if self._holds(literal, value):
                same |= mask
        restorers = graph.last_before(task, same)
        others = every & ~same
        for restorer in restorers:
            others &= ~graph.before(restorer)
        writer = graph.first_not_after(task, others)
        if writer is not None:
            verb = "makes" if graph.precedes(writer, task) else "may make"
            made = render_value(self._writers.value(writer, variable))
            self._unmet("condition-undone", task, literal, f"{writer} {verb} it {made} before")
        elif not restorers:
            self._check_at_start(task, literal)

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
        elif not self._holds(literal, has):
            state = "that is not known" if has is None else f"it is {has}"
            self._unmet("condition-unmet", task, literal, f"at the start {state}")

    def _unmet(self, code: str, task: str, literal: Literal, why: str) -> None:
        (relation, subject), value = literal
        value = bare_name(value) if isinstance(value, str) else value
        condition = Condition(relation=relation, subject=bare_name(subject), value=value)
        self._report(code, f"{task} needs {literal}, and {why}", task, condition)

    def _check_space(self, task: str, carrier: str) -> None:
        if carrier in self._world.objects or self._moved_by_chance:
            if actor_in(carrier) is None and carrier not in self._too_full:
                found = len(self.violations)
                self._check_formula(task, self._has_room(carrier), f"room on or in {carrier}")
                if len(self.violations) > found:
                    self._too_full.add(carrier)  # said once, and not of all that is put there
            return
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

    @cached_property
    def _may_be_at(self) -> Mapping[Value, list[str]]:
        """By carrier, the things that are there directly at some time, as far as one can tell."""
        found: dict[Value, list[str]] = defaultdict(list)
        for thing in self._world.objects:
            for carrier in self._values_of(FactKey(AT, thing)):
                found[carrier].append(thing)
        return found

    def _has_room(self, carrier: str) -> Formula:
        """That there is room for one more thing, see `room_left`."""
        things = self._may_be_at[carrier]
        if len(things) < (room := capacity(carrier, self._world)):
            return TRUE
        rows = []
        for thing in things:
            there: Formula = Stored(Literal(FactKey(AT, thing), carrier))
            if carrier in self._world.robots:
                held = Stored(Literal(FactKey(HOLDING, carrier), thing))
                there = And((there, Not(held)))
            rows.append(Total("", "", there, Constant(1)))
        return Compare(Sum(tuple(rows)), "<", Constant(room))
