"""Formulas in every order that the graph allows, decided exactly.

A formula holds before a task if it does after each set of other tasks that can be done by then, in
whatever order they were. Only tasks matter that write what the formula reads, or what effects that
depend on something read (and so on), and of those only the ones that may have had the last word.
Mostly the values that are possible variable by variable decide it. Where they do not, pairs of a
downset of those tasks and the values it leads to are enumerated, up to a limit; beyond that the
order of some tasks must be said.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from fleet.core.checker.writers import Writers
from fleet.core.model.formulas.abstraction import outcomes, reads
from fleet.core.model.formulas.effects import carried_out
from fleet.core.model.formulas.evaluation import conjuncts, evaluate, expanded
from fleet.core.model.formulas.nodes import Formula
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey, Value

MOST_LOOKED_AT = 100_000
"""Values of variables, state by state, that are looked at for one condition."""
MOST_LOOKED_AT_IN_PLAN = 500_000
"""The same for all conditions of a plan together: about a second."""
MOST_NAMED = 6
"""Tasks named in a sentence that says what is to be ordered."""
State = tuple[Value, ...]


class Undecided(Exception):
    """It depends on which robot an actor will be."""


def listed(tasks: Sequence[str]) -> str:
    """Tasks as a sentence names them, if there are many the first few."""
    names = ", ".join(tasks[:MOST_NAMED])
    more = len(tasks) - MOST_NAMED
    return f"{names} and {more} more" if more > 0 else names


@dataclass(frozen=True)
class Failure:
    """A part of a formula that does not hold, or need not, after these tasks in some order; where
    there are too many orders to say, `open` is set, and `after` are tasks whose order is open."""

    part: Formula
    after: tuple[str, ...]
    open: bool = False


class ReachableStates:
    """Decides formulas before tasks of one plan. `start` is the value of a variable before the
    plan; it may raise `Undecided`."""

    def __init__(
        self,
        graph: TaskGraph,
        writers: Writers,
        world: WorldModel,
        start: Callable[[FactKey], Value],
    ) -> None:
        self._graph, self._writers, self._world, self._start = graph, writers, world, start
        self._left = MOST_LOOKED_AT_IN_PLAN
        self._gave_up = False
        self._explored: dict[frozenset[FactKey], Mapping[int, Collection[State]] | None] = {}

    def failure(
        self, formula: Formula, task: str | None, *, aboard: bool = False
    ) -> Failure | None:
        """What of the formula does not hold whenever `task` may begin, or (`None`) when all is
        done; `aboard` as in a goal.

        Raises:
            Undecided: it depends on which robots actors will be.
        """
        undecided = False
        for part in conjuncts(expanded(formula, self._world)):
            try:
                found = self._part(part, task, aboard)
            except Undecided:
                undecided = True
                continue
            if found is not None:
                return found
        if undecided:
            raise Undecided
        return None

    def read_for(self, part: Formula) -> frozenset[FactKey]:
        """The variables that may decide it, at whatever time; start values of actors aside."""

        def ever(variable: FactKey) -> Collection[Value] | None:
            try:
                return self._ever(variable)
            except Undecided:
                return self._writers.values(variable) or None

        return self._closure(reads(part, ever, self._world))

    def failure_at_any_time(self, formula: Formula, *, aboard: bool = False) -> Failure | None:
        """What of the formula does not hold all the time, before and after each task.

        Raises:
            Undecided: it depends on which robots actors will be.
        """
        for part in conjuncts(expanded(formula, self._world)):
            _, may_not = outcomes(part, self._ever, self._world, aboard=aboard)
            if not may_not:
                continue
            read = self._closure(reads(part, self._ever, self._world, aboard=aboard))
            if (found := self._in_all_states(part, None, read, aboard, at_end=False)) is not None:
                return found
        return None

    def failure_of_order(
        self, first: Formula, then: Formula, *, aboard: bool = False
    ) -> Failure | None:
        """Where `then` holds and `first` never did before, in some order of the tasks.

        Raises:
            Undecided: it depends on which robots actors will be.
        """
        first, then = (expanded(formula, self._world) for formula in (first, then))
        may, _ = outcomes(then, self._ever, self._world, aboard=aboard)
        if not may:
            return None
        read = reads(then, self._ever, self._world, aboard=aboard)
        read |= reads(first, self._ever, self._world, aboard=aboard)
        variables = sorted(self._closure(read))
        mask = 0
        for variable in variables:
            mask |= self._writers.mask(variable)
        stepped = self._stepping(variables)

        def holds(formula: Formula, state: State) -> bool:
            known = dict(zip(variables, state, strict=False))
            return evaluate(formula, known.get, self._world, aboard=aboard)

        def after(name: str, state: State) -> State:
            # Behind the values stands whether `first` has held in a state before this one.
            *values, passed = state
            return (*stepped(name, tuple(values)), passed or holds(first, state))

        start = (*(self._start(variable) for variable in variables), False)
        for done, state in self._explore(mask, start, after):
            if not state[-1] and holds(then, state):
                return Failure(then, self._graph.named(done))
        return self._too_many(then, mask) if self._gave_up else None

    def _part(self, part: Formula, task: str | None, aboard: bool) -> Failure | None:
        seen: dict[FactKey, tuple[int, bool]] = {}

        def possible(variable: FactKey) -> Collection[Value] | None:
            return self._possible(variable, task, seen)

        may, may_not = outcomes(part, possible, self._world, aboard=aboard)
        if not may_not:
            return None
        read = reads(part, possible, self._world, aboard=aboard)
        relevant = 0
        for variable in read:
            relevant |= self._seen(variable, task, seen)[0]
        guarded = any(self._seen(v, task, seen)[0] & self._writers.guarded_mask(v) for v in read)
        if not may:
            must = self._graph.before(task) if task is not None else relevant
            return Failure(part, self._graph.named(relevant & must))
        if guarded:
            return self._in_all_states(part, task, self._closure(read), aboard)
        return self._in_seen_states(part, task, read, seen, relevant, aboard)

    def _seen(
        self, variable: FactKey, task: str | None, seen: dict[FactKey, tuple[int, bool]]
    ) -> tuple[int, bool]:
        if variable not in seen:
            seen[variable] = self._writers.seen(variable, task)
        return seen[variable]

    def _possible(
        self, variable: FactKey, task: str | None, seen: dict[FactKey, tuple[int, bool]]
    ) -> Collection[Value] | None:
        """The values that a variable may have when the task begins."""
        mask, at_start = self._seen(variable, task, seen)
        writers = self._writers
        if mask & writers.guarded_mask(variable):
            if variable in writers.numeric:
                return None
            return {*writers.values(variable), *((self._start(variable),) if at_start else ())}
        values = {writers.value(name, variable) for name in self._graph.named(mask)}
        if at_start:
            values.add(self._start(variable))
        return values

    def _in_seen_states(
        self,
        part: Formula,
        task: str | None,
        read: Collection[FactKey],
        seen: Mapping[FactKey, tuple[int, bool]],
        relevant: int,
        aboard: bool,
    ) -> Failure | None:
        """Where each write is of a certain value: what is overwritten anyhow is left out."""
        graph, writers = self._graph, self._writers
        fixed: dict[FactKey, Value] = {}
        varying: list[FactKey] = []
        before = graph.before(task) if task is not None else relevant
        for variable in sorted(read):
            mask, _ = seen[variable]
            names = graph.named(mask)
            if not names:
                fixed[variable] = self._start(variable)
            elif len(names) == 1 and mask & before:
                fixed[variable] = writers.value(names[0], variable)
            else:
                varying.append(variable)
        writes: dict[str, dict[int, Value]] = {}
        for number_, variable in enumerate(varying):
            for name in graph.named(seen[variable][0]):
                writes.setdefault(name, {})[number_] = writers.value(name, variable)
        first = tuple(self._start(variable) if seen[variable][1] else None for variable in varying)

        def after(name: str, state: State) -> State:
            values = list(state)
            for index, value in writes[name].items():
                values[index] = value
            return tuple(values)

        def is_bad(state: State) -> bool:
            known = {**fixed, **dict(zip(varying, state, strict=True))}
            return not evaluate(part, known.get, self._world, aboard=aboard)

        mask = graph.mask(writes)
        must = mask & before
        # Mostly it is with nothing else done, or with all that can be.
        for done in (must, mask):
            state = first
            for name in graph.named(done):
                state = after(name, state)
            if is_bad(state):
                return Failure(part, graph.named(done))
        for done, state in self._explore(mask, first, after):
            if done & must == must and is_bad(state):
                return Failure(part, graph.named(done))
        return self._too_many(part, mask) if self._gave_up else None

    def _in_all_states(
        self,
        part: Formula,
        task: str | None,
        read: frozenset[FactKey],
        aboard: bool,
        at_end: bool = True,
    ) -> Failure | None:
        """Every state from the start on, where effects depend on what holds: those before the task,
        or (`None`) those when all is done, or without `at_end` all that there are."""
        graph = self._graph
        mask = 0
        for variable in read:
            mask |= self._writers.mask(variable)
        variables = sorted(read)
        if read not in self._explored:
            first = tuple(self._start(variable) for variable in variables)
            states: dict[int, list[State]] = {}
            for done, state in self._explore(mask, first, self._stepping(variables)):
                states.setdefault(done, []).append(state)
            self._explored[read] = None if self._gave_up else states
        explored = self._explored[read]
        if explored is None:
            return self._too_many(part, mask)
        must, never = mask, 0
        if task is not None:
            must &= graph.before(task)
            never = graph.behind(task) | graph.mask((task,))
        elif not at_end:
            must = 0
        judged: dict[State, bool] = {}
        for done, states_then in explored.items():
            if done & must != must or done & never:
                continue
            for state in states_then:
                if state not in judged:
                    known = dict(zip(variables, state, strict=True))
                    judged[state] = evaluate(part, known.get, self._world, aboard=aboard)
                if not judged[state]:
                    return Failure(part, graph.named(done))
        return None

    def _stepping(self, variables: list[FactKey]) -> Callable[[str, State], State]:
        """What a task makes of the values of these variables."""
        index = {variable: number_ for number_, variable in enumerate(variables)}

        def after(name: str, state: State) -> State:
            values = list(state)
            for variable, value in self._writers.plain_of(name):
                if variable in index:
                    values[index[variable]] = value
            known = dict(zip(variables, state, strict=True))
            rows = [row for row in self._writers.guarded.get(name, ()) if row.variable in index]
            for variable, value in carried_out(rows, known.get, self._world):
                values[index[variable]] = value
            return tuple(values)

        return after

    def _closure(self, read: Collection[FactKey]) -> frozenset[FactKey]:
        """These variables, and those that decide what effects make of them."""
        found, open_ = set(read), list(read)
        while open_:
            variable = open_.pop()
            for name in self._graph.named(self._writers.guarded_mask(variable)):
                for row in self._writers.guarded[name]:
                    if row.variable != variable:
                        continue
                    needed = reads(row.when, self._ever, self._world)
                    if row.to is not None:
                        needed |= reads(row.to, self._ever, self._world)
                    open_.extend(needed - found)
                    found |= needed
        return frozenset(found)

    def _ever(self, variable: FactKey) -> Collection[Value] | None:
        if variable in self._writers.numeric:
            return None
        return {*self._writers.values(variable), self._start(variable)}

    def _explore(
        self, mask: int, first: State, after: Callable[[str, State], State]
    ) -> Iterator[tuple[int, State]]:
        """Every downset of the tasks in `mask` with each state that it leads to. It ends early,
        and says so in `_gave_up`, where those are too many."""
        graph = self._graph
        names = graph.named(mask)
        bits = [(name, graph.mask((name,)), graph.before(name) & mask) for name in names]
        self._gave_up = False
        stack, known = [(0, first)], {(0, first)}
        left = MOST_LOOKED_AT
        while stack:
            if self._left <= 0 or left <= 0:
                self._gave_up = True
                return
            left -= len(first) + 1
            self._left -= len(first) + 1
            done, state = stack.pop()
            yield done, state
            for name, bit, befores in bits:
                if not done & bit and done & befores == befores:
                    reached = done | bit, after(name, state)
                    if reached not in known:
                        known.add(reached)
                        stack.append(reached)

    def _too_many(self, part: Formula, mask: int) -> Failure:
        graph = self._graph
        unordered = (
            name
            for name in graph.named(mask)
            if mask & ~(graph.before(name) | graph.behind(name) | graph.mask((name,)))
        )
        return Failure(part, tuple(islice(unordered, MOST_NAMED)), open=True)
