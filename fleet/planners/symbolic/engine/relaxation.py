"""Heuristics from the delete relaxation: what is once true stays so (Bonet and Geffner 2001).

The cost of an operator is that of what it needs (of the dearest, h_max, or of all, h_add) and its
own. Beside its cost each fact remembers where the robots that made it true stand then: a robot that
picked a cup up here has to drive from here to where the cup is put down. Without this most of the
cost of a transport is not seen. h_max with it does not overestimate where ways are not made shorter
by other places between.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf
from typing import NamedTuple

from fleet.core.model.formulas.evaluation import conjuncts
from fleet.core.model.formulas.nodes import Formula
from fleet.planners.symbolic.engine.alternatives import Quorum
from fleet.planners.symbolic.engine.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.engine.nodes import Stands, State
from fleet.planners.symbolic.engine.relaxed_rows import AXIOM, relaxed_rows
from keyexpr_schema.facts import Value


class Label(NamedTuple):
    """One way to make a fact true: its cost, where its robots stand then, and how it came."""

    cost_s: float
    stands: Stands
    robots: frozenset[str]
    """All that had a part in it."""
    step: int
    """The number of its row; -1: it holds."""
    causes: tuple[Label, ...]


@dataclass(frozen=True)
class Estimate:
    """What it still takes from a state, and the operators of a relaxed plan that can be done now.

    `cost_s` is infinite where the goal is out of reach even so.
    """

    cost_s: float
    first: frozenset[int]
    steps: tuple[int, ...]


MAX_LABELS = 3
"""Ways remembered for each fact: the cheapest, and others that leave robots somewhere else."""
_NOBODY: frozenset[str] = frozenset()


class Relaxation:
    """The relaxed task; `additive` sums up what an operator needs (h_add), else h_max. `labels` are
    the ways remembered for each node: with one only, it is quick, and may overestimate. `by_plan`
    the estimate is what the operators of the relaxed plan cost together, each once (h_FF, Hoffmann
    and Nebel 2001): seldom much too high, and far nearer than h_max where much has to be done.
    """

    def __init__(
        self,
        task: FiniteDomainTask,
        additive: bool,
        labels: int = MAX_LABELS,
        by_plan: bool = False,
    ) -> None:
        self._task = task
        self._additive = additive
        self._by_plan = by_plan
        self._most_labels = labels
        self._costs = [operator.cost_s for operator in task.operators]
        rows = relaxed_rows(task)
        self._goal = len(rows) - 1
        self._operator = [row.operator for row in rows]
        self._needs = [row.needs for row in rows]
        self._stands = [row.stands for row in rows]
        self._robots = [frozenset(robot for robot, _ in row.stands) for row in rows]
        self._writes = [row.writes for row in rows]
        self._counts = frozenset(n for n, row in enumerate(rows) if row.least < len(row.needs))
        self._used_by: dict[int, list[int]] = defaultdict(list)
        for number, row in enumerate(rows):
            for need in row.needs:
                self._used_by[need].append(number)
        self._open = [row.least for row in rows]
        self._free_of_needs = [n for n, row in enumerate(rows) if row.least <= 0]

    def estimate(self, state: State, charge_s: list[float]) -> Estimate:
        """What it takes from a state to the goal; `charge_s` are extra costs of the operators."""
        reached = self._explored(state, charge_s, {})
        if reached is None:
            return Estimate(inf, frozenset(), ())
        steps: dict[int, None] = {}
        own_s = {self._goal: _own_s(reached)}
        first: set[int] = set()
        todo = list(reached.causes)
        seen: set[int] = set()
        while todo:
            label = todo.pop()
            if label.step < 0 or id(label) in seen:
                continue
            seen.add(id(label))
            todo.extend(label.causes)
            step = self._operator[label.step]
            if step == AXIOM:
                own_s.setdefault(label.step, _own_s(label))
                continue
            own_s.setdefault(step, _own_s(label))
            steps[step] = None
            if all(cause.step < 0 for cause in label.causes):
                first.add(step)
        cost_s = sum(own_s.values()) if self._by_plan else reached.cost_s
        return Estimate(cost_s, frozenset(first), tuple(reversed(steps)))

    def costs_s(self, state: State) -> dict[int, float]:
        """What each node takes that can come to hold."""
        labels: dict[int, list[Label]] = {}
        self._explored(state, [0.0] * len(self._costs), labels, to_goal=False)
        return {node: ways[0].cost_s for node, ways in labels.items()}

    def _explored(
        self,
        state: State,
        charge_s: list[float],
        labels: dict[int, list[Label]],
        to_goal: bool = True,
    ) -> Label | None:
        """Dijkstra's search over nodes, up to the goal or all of them; fills in their `labels`."""
        task, most = self._task, self._most_labels
        way_s, value_of = task.travel.way_s, task.nodes.value_of
        here = {robot: value_of[state[v]] for robot, v in task.position.items()}
        open_ = self._open.copy()
        done_s: dict[int, float] = {}
        holds = Label(0.0, (), _NOBODY, -1, ())
        # Ties are broken by a number that is unique, so that labels are never compared.
        queue: list[tuple[float, int, int, Label]] = [
            (0.0, ticket, node, holds) for ticket, node in enumerate(task.nodes.true_nodes(state))
        ]
        ticket = len(queue)
        ready = self._free_of_needs
        goal, writes_of, used_by = self._goal, self._writes, self._used_by
        while True:
            for number in ready:
                label = self._label(number, labels, here, way_s, charge_s)
                cost_s = label.cost_s
                if cost_s >= done_s.get(number, inf):
                    continue
                done_s[number] = cost_s
                ticket += 1
                if number == goal and to_goal:
                    heappush(queue, (cost_s, ticket, -1, label))
                for node in writes_of[number]:
                    known = labels.get(node)
                    if known is None or (len(known) < most and not _dominated(label, known, way_s)):
                        heappush(queue, (cost_s, ticket, node, label))
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
            elif len(known) < most and not _dominated(label, known, way_s):
                known.append(label)
                ready = [number for number in used_by.get(node, ()) if open_[number] == 0]

    def _label(
        self,
        number: int,
        labels: dict[int, list[Label]],
        here: dict[str, Value],
        way_s: dict[tuple[str, Value, str], float],
        charge_s: list[float],
    ) -> Label:
        """The cheapest way to do an operator, from what is known of the nodes that it needs."""
        stands = self._stands[number]
        dearest_s, involved, causes = 0.0, _NOBODY, []
        for robot, place in stands:
            dearest_s += way_s[robot, here[robot], place]
        needs: Iterable[int] = self._needs[number]
        if number in self._counts:
            needs = filter(labels.__contains__, needs)
        for need in needs:
            best, best_s = None, inf
            for label in labels[need]:
                spent_s = label.cost_s
                if spent_s >= best_s:
                    continue
                for robot, place in stands:
                    if robot in label.robots:
                        for other, stood in label.stands:
                            if other == robot:
                                spent_s += way_s[robot, stood, place]
                    else:
                        spent_s += way_s[robot, here[robot], place]
                if best is None or spent_s < best_s:
                    best, best_s = label, spent_s
            assert best is not None
            causes.append(best)
            if best_s >= dearest_s:
                dearest_s, involved = best_s, best.robots
        if self._additive and len(causes) > 1:
            # The ways of its robots are counted once, with the dearest.
            spent = [cause.cost_s for cause in causes]
            dearest_s = sum(spent) + max(0.0, dearest_s - max(spent))
            involved = _NOBODY.union(*(cause.robots for cause in causes))
        operator = self._operator[number]
        if operator != AXIOM:
            dearest_s += self._costs[operator] + charge_s[operator]
        elif not stands and len(causes) == 1:
            stands = causes[0].stands  # an axiom moves nobody
        return Label(dearest_s, stands, involved | self._robots[number], number, tuple(causes))


def _own_s(label: Label) -> float:
    """What a step adds to what it needs, where that is summed up."""
    return max(0.0, label.cost_s - sum(cause.cost_s for cause in label.causes))


def _dominated(
    label: Label, known: list[Label], way_s: dict[tuple[str, Value, str], float]
) -> bool:
    """Whether one of the known ways is as good, wherever its robots have to go next."""
    for other in known:
        spent_s = other.cost_s
        if spent_s > label.cost_s:
            continue
        for robot, place in label.stands:
            for same, stood in other.stands:
                if same == robot:
                    spent_s += way_s[robot, stood, place]
        if spent_s <= label.cost_s:
            return True
    return False


SPARE = 3
"""Alternatives looked at besides as many of the cheapest as it takes."""


def least_dear(
    undecided: Mapping[Quorum, Quorum], task: FiniteDomainTask
) -> dict[Quorum, tuple[Formula, ...]]:
    """Of what is missing of alternatives those that take least, and a few more."""
    costs_s = Relaxation(task, additive=True).costs_s(task.initial)

    def cost_s(row: Formula) -> float:
        nodes = map(task.conditions.formula, conjuncts(row))
        return sum(0.0 if node is True else costs_s.get(node, inf) for node in nodes)

    return {
        quorum: tuple(sorted(missing.of, key=cost_s)[: missing.least + SPARE])
        for quorum, missing in undecided.items()
    }
