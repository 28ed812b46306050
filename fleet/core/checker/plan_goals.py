"""What must hold when a plan is done, or all the time while it is carried out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fleet.core.checker.actor_requirements import Requirement
from fleet.core.checker.reachable_states import Failure, ReachableStates, Undecided, listed
from fleet.core.checker.writers import Writers
from fleet.core.model.formulas.evaluation import disjunction, negation
from fleet.core.model.formulas.nodes import Formula, Holds
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel, condition_holds
from keyexpr_schema.facts import FactKey, Literal, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Precedence
from keyexpr_schema.payloads.plans import Plan, Violation


class PlanGoals:
    """The conditions of one plan's goals, in every order of its graph."""

    def __init__(
        self,
        plan: Plan,
        world: WorldModel,
        graph: TaskGraph,
        writers: Writers,
        states: ReachableStates,
    ) -> None:
        self._plan, self._world, self._graph = plan, world, graph
        self._writers, self._states = writers, states

    def violations(self, requirements: Mapping[str, Requirement] | None) -> Iterator[Violation]:
        """What does not hold at the end, or at some time, as it must; `requirements` are those of
        actors, where robots are not chosen yet."""
        final = {} if requirements is None else self._final_facts(requirements)
        for condition in self._plan.conditions:
            formula = _formula_of(condition)
            try:
                failure = self._states.failure(formula, None, aboard=True)
            except Undecided:
                failure = Failure(formula, ())
            if failure is None:
                continue
            if requirements is not None and condition_holds(final, condition, self._world):
                continue
            sentence = f"{condition} does not hold when the plan is done"
            if failure.open:
                sentence = (
                    f"whether {condition} holds when the plan is done depends on the order of too "
                    f"many tasks: say which of {listed(failure.after)} come first"
                )
            yield Violation(code="goal-unmet", sentence=sentence, condition=condition)
        for condition in self._plan.always:
            yield from self._at_any_time(condition, wanted=True)
        for condition in self._plan.never:
            yield from self._at_any_time(condition, wanted=False)
        for row in self._plan.sometime_before:
            yield from self._in_order(row)

    def _at_any_time(self, condition: Condition, wanted: bool) -> Iterator[Violation]:
        formula = _formula_of(condition)
        try:
            failure = self._states.failure_at_any_time(
                formula if wanted else negation(formula), aboard=True
            )
        except Undecided:
            return
        if failure is None:
            return
        must, does = ("must always", "does not") if wanted else ("must never", "does")
        when = f"after {listed(failure.after)}" if failure.after else "at the start"
        sentence = f"{condition} {must} hold, and {does} {when}"
        if failure.open:
            sentence = (
                f"{condition} {must} hold, and whether it does depends on the order of too many "
                f"tasks: say which of {listed(failure.after)} come first"
            )
        yield Violation(code="constraint-violated", sentence=sentence, condition=condition)

    def _in_order(self, row: Precedence) -> Iterator[Violation]:
        try:
            failure = self._states.failure_of_order(
                _formula_of(row.first), _formula_of(row.then), aboard=True
            )
        except Undecided:
            return
        if failure is None:
            return
        when = f"after {listed(failure.after)}" if failure.after else "at the start"
        sentence = f"{row.first} must hold before {row.then} does, and need not have {when}"
        if failure.open:
            sentence = (
                f"{row.first} must hold before {row.then} does, and whether it does depends on the "
                f"order of too many tasks: say which of {listed(failure.after)} come first"
            )
        yield Violation(code="constraint-violated", sentence=sentence, condition=row.then)

    def _final_facts(self, requirements: Mapping[str, Requirement]) -> dict[FactKey, Value]:
        """Every variable at the end; unknown where the order of its last writers is open."""
        final: dict[FactKey, Value] = dict(self._world.facts)
        # What is required of an actor at the start holds of the robot that will be it.
        for actor, requirement in requirements.items():
            for relation, (value, _) in requirement.facts.items():
                final[FactKey(relation, actor)] = value
        for variable, rows in self._writers.plain.items():
            values = dict(rows)
            lasts = self._graph.last_of(self._writers.plain_mask(variable))
            last = {values[task] for task in lasts}
            final[variable] = last.pop() if len(last) == 1 else None
        pinned = {actor_arg(actor): robot for actor, robot in self._plan.pins.items()}
        for variable in self._writers.plain:
            value = final[variable]
            if isinstance(value, str) and value in pinned:
                value = final[variable] = pinned[value]
            if variable.subject in pinned:
                final[FactKey(variable.relation, pinned[variable.subject])] = value
        return final


def _formula_of(condition: Condition) -> Formula:
    relation, value = condition.relation, condition.value
    found = disjunction(Holds(Literal(FactKey(relation, s), value)) for s in condition.subjects)
    return negation(found) if condition.negated else found
