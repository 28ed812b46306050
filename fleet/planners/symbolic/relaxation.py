"""Heuristics from the delete relaxation: what is once true stays so (Bonet and Geffner 2001).

The cost of an operator is that of what it needs (of the dearest, h_max, or of all, h_add) and its
own. Beside its cost each fact remembers where the robots that made it true stand then: a robot that
picked a cup up here has to drive from here to where the cup is put down. Without this most of the
cost of a transport is not seen. h_max with it does not overestimate where ways are not made shorter
by other places between.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from typing import NamedTuple

from fleet.planners.symbolic.finite_domain import FiniteDomainTask, Operator, Stands, State
from keyexpr_schema.facts import Value


class Label(NamedTuple):
    """One way to make a fact true: its cost, where its robots stand then, and how it came."""

    cost_s: float
    stands: Stands
    robots: frozenset[str]
    """All that had a part in it."""
    step: int
    """The operator's number; an axiom's is beyond; -1: it holds."""
    causes: tuple[Label, ...]


@dataclass(frozen=True)
class Estimate:
    """What it still takes from a state, and the operators of a relaxed plan that can be done now.

    `cost_s` is infinite where the goal is out of reach even so.
    """

    cost_s: float
    first: frozenset[int]
    steps: tuple[int, ...]


_NOBODY: frozenset[str] = frozenset()


class Relaxation:
    """The relaxed task; `additive` sums up what an operator needs (h_add), else h_max."""

    def __init__(self, task: FiniteDomainTask, additive: bool) -> None:
        self._task = task
        self._additive = additive
        self._operators = len(task.operators)
        rows: list[tuple[tuple[int, ...], Stands, tuple[int, ...]]] = [
            (operator.needs, operator.stands, (*operator.writes, *task.rides_by.get(number, ())))
            for number, operator in enumerate(task.operators)
        ]
        rows += [(axiom.needs, axiom.stands, (axiom.reading,)) for axiom in task.axioms]
        self._goal = len(rows)
        rows.append((task.goal_needs, task.goal_stands, ()))
        self._needs = [tuple(set(needs)) for needs, _, _ in rows]
        self._stands = [stands for _, stands, _ in rows]
        self._robots = [frozenset(robot for robot, _ in stands) for _, stands, _ in rows]
        self._writes = [writes for _, _, writes in rows]
        self._used_by: dict[int, list[int]] = defaultdict(list)
        for number, needs in enumerate(self._needs):
            for need in needs:
                self._used_by[need].append(number)
        self._open = [len(needs) for needs in self._needs]
        self._free_of_needs = [n for n, needs in enumerate(self._needs) if not needs]

    def estimate(self, state: State, charge_s: list[float]) -> Estimate:
        """What it takes from a state to the goal; `charge_s` are extra costs of the operators."""
        reached = self._explored(state, charge_s)
        if reached is None:
            return Estimate(inf, frozenset(), ())
        steps: dict[int, None] = {}
        first: set[int] = set()
        todo = list(reached.causes)
        seen: set[int] = set()
        while todo:
            label = todo.pop()
            if label.step < 0 or id(label) in seen:
                continue
            seen.add(id(label))
            todo.extend(label.causes)
            if label.step < self._operators:
                steps[label.step] = None
                if all(cause.step < 0 for cause in label.causes):
                    first.add(label.step)
        return Estimate(reached.cost_s, frozenset(first), tuple(reversed(steps)))

    def _explored(self, state: State, charge_s: list[float]) -> Label | None:
        """Dijkstra's search over facts, up to the goal."""
        task = self._task
        cost_s, value_of = task.travel.cost_s, task.value_of
        here = {robot: value_of[state[v]] for robot, v in task.position.items()}
        labels: dict[int, list[Label]] = {}
        open_ = self._open.copy()
        done_s: dict[int, float] = {}
        holds = Label(0.0, (), _NOBODY, -1, ())
        # Ties are broken by a number that is unique, so that labels are never compared.
        queue: list[tuple[float, int, int, Label]] = [
            (0.0, ticket, node, holds) for ticket, node in enumerate(task.true_nodes(state))
        ]
        ticket = len(queue)
        ready = self._free_of_needs
        writes_of, used_by = self._writes, self._used_by
        while True:
            for number in ready:
                label = self._label(number, labels, here, cost_s, charge_s)
                if label.cost_s >= done_s.get(number, inf):
                    continue
                done_s[number] = label.cost_s
                if number == self._goal:
                    ticket += 1
                    heappush(queue, (label.cost_s, ticket, -1, label))
                for node in writes_of[number]:
                    known = labels.get(node)
                    if known is None or not _dominated(label, known, cost_s):
                        ticket += 1
                        heappush(queue, (label.cost_s, ticket, node, label))
            if not queue:
                return None
            _, _, node, label = heappop(queue)
            if node < 0:
                return label
            known = labels.get(node)
            ready = []
            if known is None:
                labels[node] = [label]
                for number in used_by.get(node, ()):
                    open_[number] -= 1
                    if open_[number] == 0:
                        ready.append(number)
            elif not _dominated(label, known, cost_s):
                known.append(label)
                ready = [number for number in used_by.get(node, ()) if open_[number] == 0]

    def _label(
        self,
        number: int,
        labels: dict[int, list[Label]],
        here: dict[str, Value],
        cost_s: Callable[[str, Value, str], float],
        charge_s: list[float],
    ) -> Label:
        """The cheapest way to do an operator, from what is known of the facts that it needs."""
        stands, robots = self._stands[number], self._robots[number]
        own_s = 0.0
        if number < self._operators:
            own_s = self._task.operators[number].cost_s + charge_s[number]
        causes: list[Label] = []
        from_here = {robot: cost_s(robot, here[robot], place) for robot, place in stands}
        total_s, dearest_s, involved = 0.0, sum(from_here.values()), _NOBODY
        for need in self._needs[number]:
            best, best_s = None, inf
            for label in labels[need]:
                if label.cost_s >= best_s:
                    continue
                at = dict(label.stands)
                way_s = 0.0
                for robot, place in stands:
                    if robot in at:
                        way_s += cost_s(robot, at[robot], place)
                    elif robot not in label.robots:
                        way_s += from_here[robot]
                if best is None or label.cost_s + way_s < best_s:
                    best, best_s = label, label.cost_s + way_s
            assert best is not None
            causes.append(best)
            total_s += best_s
            if best_s >= dearest_s:
                dearest_s, involved = best_s, best.robots
        if self._additive and len(causes) > 1:
            # The ways of its robots are counted once, with the dearest.
            total_s = sum(cause.cost_s for cause in causes)
            total_s += max(0.0, dearest_s - max(cause.cost_s for cause in causes))
            involved = _NOBODY.union(*(cause.robots for cause in causes))
            dearest_s = total_s
        return Label(dearest_s + own_s, stands, involved | robots, number, tuple(causes))


def _dominated(
    label: Label, known: list[Label], cost_s: Callable[[str, Value, str], float]
) -> bool:
    """Whether one of the known ways is as good, wherever its robots have to go next."""
    for other in known:
        if other.cost_s > label.cost_s:
            continue
        at = dict(other.stands)
        way_s = sum(cost_s(robot, at[robot], place) for robot, place in label.stands if robot in at)
        if other.cost_s + way_s <= label.cost_s:
            return True
    return False


def reachable_operators(task: FiniteDomainTask) -> tuple[list[Operator], set[int]]:
    """The operators that can ever be done as if nothing ceased to hold, and the facts and readings
    that can be true then.
    """
    rows = [
        (operator.needs, (*operator.writes, *task.rides_by.get(number, ())))
        for number, operator in enumerate(task.operators)
    ]
    rows += [(a.needs, (a.reading,)) for a in task.axioms]
    open_ = [len(set(needs)) for needs, _ in rows]
    used_by: dict[int, list[int]] = defaultdict(list)
    for number, (needs, _) in enumerate(rows):
        for need in set(needs):
            used_by[need].append(number)
    todo = task.true_nodes(task.initial)
    true = set(todo)
    ready = [number for number, left in enumerate(open_) if left == 0]
    done: set[int] = set()
    while todo or ready:
        for number in ready:
            done.add(number)
            for node in rows[number][1]:
                if node not in true:
                    true.add(node)
                    todo.append(node)
        ready = []
        if todo:
            for number in used_by.get(todo.pop(), ()):
                open_[number] -= 1
                if open_[number] == 0:
                    ready.append(number)
    return [task.operators[n] for n in sorted(done) if n < len(task.operators)], true
