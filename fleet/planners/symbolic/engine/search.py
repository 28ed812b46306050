"""The cheapest sequence of actions for a task: A* (Hart, Nilsson and Raphael 1968), anytime.

First A* with h_max: what it finds is the cheapest. Where that takes long, A* with h_FF looks for a
cheap one; where that takes long, too, a greedy search with h_add for any. Then the first goes on,
within limits, for a cheaper one; with patience, so does A* with a part of h_FF, which overestimates
less. States are estimated when it is their turn, not when they are made; what a relaxed plan begins
with has its turn first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf

from fleet.core.model.skills import Action
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.symbolic.engine.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.engine.instantiation import Facts
from fleet.planners.symbolic.engine.nodes import State
from fleet.planners.symbolic.engine.relaxation import Estimate, Relaxation
from fleet.planners.symbolic.engine.travel import Moves

FIRST_STATES = 200
"""States that A* looks at before a greedy search is tried."""
CHEAP_STATES = 1500
"""States that A* with h_FF looks at before any sequence will do."""
CHEAP_SHARE = 0.5
"""Of the time, how much that has at most."""
IMPROVING_STATES = 600
"""States that A* looks at in all where there is a sequence already."""
PATIENT = ((0.9, 600), (0.8, 600), (0.6, 900))
"""With patience: parts of h_FF, and how many states A* with each looks at for a cheaper one."""
OTHER_STATES = 15
"""States looked at for another sequence that uses other actions."""
MAX_STATES = 500_000
"""States known before a search gives up even with time left: about half a gigabyte of them."""
GREED = 5.0
"""How much more a greedy search trusts its estimate than what it has spent."""


@dataclass(frozen=True)
class Solution:
    """A sequence of actions, its cost [s], and the facts it leads to."""

    actions: tuple[Action, ...]
    cost_s: float
    facts: Facts


@dataclass(frozen=True)
class Unreachable:
    """Every state that can be reached was looked at, or the goal is out of reach from the first."""


@dataclass(frozen=True)
class Unfinished:
    """The search was ended before it knew; what would still be missing where it came nearest."""

    nearest: tuple[Action, ...]
    """A relaxed plan for the rest."""
    states: int


@dataclass(slots=True)
class _Node:
    state: State
    spent_s: float
    parent: _Node | None
    operator: int
    """-1 for the moves to the goal."""
    moves: Moves


class Search:
    """One best-first search that can be gone on with."""

    def __init__(
        self, task: FiniteDomainTask, relaxation: Relaxation, charge_s: list[float], greed: float
    ) -> None:
        self._task = task
        self._relaxation = relaxation
        self._charge_s = charge_s
        self._greed = greed
        self._ticket = 0
        self._queue: list[tuple[float, bool, float, int, float, _Node, Estimate | None]] = []
        self._best: dict[State, float] = {task.initial: 0.0}
        self._closed: set[State] = set()
        self._estimates: dict[State, Estimate] = {}
        self.nearest: tuple[float, Estimate] = (inf, Estimate(inf, frozenset(), ()))
        self._push(_Node(task.initial, 0.0, None, -1, {}), 0.0, True, None)

    @property
    def states(self) -> int:
        """How many were looked at."""
        return len(self._closed)

    def run(self, budget: TimeBudget, states: int, below_s: float = inf) -> Solution | bool:
        """A solution cheaper than `below_s`; true if there is none, false if it is not known yet,
        as `states` were looked at or the time is over.
        """
        task = self._task
        while self._queue:
            if len(self._closed) >= states or len(self._best) >= MAX_STATES or budget.over:
                return False
            _, _, guess_s, _, least_s, node, estimate = heappop(self._queue)
            if node.operator < 0 and node.parent is not None:
                return self._solution(node)
            if node.state in self._closed or node.spent_s > self._best[node.state]:
                continue
            if least_s >= below_s:
                continue
            if estimate is None:
                estimate = self._estimate(node.state)
                if estimate.cost_s == inf:
                    continue
                if estimate.cost_s > guess_s:
                    self._push(node, estimate.cost_s, True, estimate)
                    continue
            self._closed.add(node.state)
            moves = task.moves_to_goal(node.state)
            if moves is not None:
                cost_s = node.spent_s + task.moves_s(node.state, moves)
                if cost_s < below_s:
                    there = task.moved(node.state, moves)
                    self._push(_Node(there, cost_s, node, -1, moves), 0.0, True, None)
            self._expand(node, estimate)
        return True

    def _expand(self, node: _Node, estimate: Estimate) -> None:
        task = self._task
        for number, moves, state in task.successors(node.state):
            step_s = task.operators[number].cost_s + self._charge_s[number]
            if moves:
                step_s += task.moves_s(node.state, moves)
            spent_s = node.spent_s + step_s
            if state in self._closed or spent_s >= self._best.get(state, inf):
                continue
            self._best[state] = spent_s
            guess_s = max(0.0, estimate.cost_s - step_s)
            self._push(
                _Node(state, spent_s, node, number, moves), guess_s, number in estimate.first, None
            )

    def _push(self, node: _Node, guess_s: float, first: bool, estimate: Estimate | None) -> None:
        self._ticket += 1
        least_s = round(node.spent_s + self._greed * guess_s, 6)
        bound_s = node.spent_s + min(1.0, self._greed) * guess_s
        row = (least_s, not first, guess_s, -self._ticket, bound_s, node, estimate)
        heappush(self._queue, row)

    def _estimate(self, state: State) -> Estimate:
        found = self._relaxation.estimate(state, self._charge_s)
        if found.cost_s < self.nearest[0]:
            self.nearest = found.cost_s, found
        return found

    def _solution(self, last: _Node) -> Solution:
        task = self._task
        cost_s = 0.0
        actions: list[Action] = []
        for node in reversed(list(_way_to(last))):
            assert node.parent is not None
            for robot, place in node.moves.items():
                drive = task.travel.action(robot, place)
                assert drive is not None
                actions.append(drive)
                origin = task.where(node.parent.state, robot)
                cost_s += task.travel.time_s(robot, origin, place)
            if node.operator >= 0:
                actions.append(task.operators[node.operator].action)
                cost_s += task.operators[node.operator].cost_s
        return Solution(tuple(actions), round(cost_s, 6), task.facts(last.state))


def _way_to(node: _Node) -> Iterator[_Node]:
    """The nodes on the way to one, the last first, without the beginning."""
    while node.parent is not None:
        yield node
        node = node.parent


class Solver:
    """Solves one task, again and again with other charges on its operators."""

    def __init__(self, task: FiniteDomainTask) -> None:
        self.task = task
        self._careful = Relaxation(task, additive=False)
        self._quick: Relaxation | None = None

    def least_s(self) -> float:
        """At least what a sequence costs [s]; infinite where the goal is out of reach."""
        nothing = [0.0] * len(self.task.operators)
        return self._careful.estimate(self.task.initial, nothing).cost_s

    def solve(
        self, charge_s: list[float], budget: TimeBudget, patient: bool = False
    ) -> Solution | Unreachable | Unfinished:
        """The cheapest sequence, or with little time a cheap one."""
        careful = Search(self.task, self._careful, charge_s, 1.0)
        found = careful.run(budget, FIRST_STATES)
        if found is True:
            return Unreachable()
        if found:
            return found
        by_plan = Relaxation(self.task, additive=True, by_plan=True)
        cheap = Search(self.task, by_plan, charge_s, 1.0)
        any_found = cheap.run(budget.part(CHEAP_SHARE), CHEAP_STATES)
        if any_found is False:
            greedy = Search(self.task, Relaxation(self.task, additive=True), charge_s, GREED)
            any_found = greedy.run(budget, MAX_STATES)
            if any_found is False:
                return _unfinished(greedy, self.task)
        if any_found is True:
            return Unreachable()
        spent_s = any_found.cost_s + sum(self._charges(any_found, charge_s))
        if not patient:
            better = careful.run(budget, IMPROVING_STATES, spent_s)
            return better if isinstance(better, Solution) else any_found
        for part, states in PATIENT:
            slow = Search(self.task, by_plan, charge_s, part)
            better = slow.run(budget, states, spent_s)
            if isinstance(better, Solution):
                any_found = better
                spent_s = better.cost_s + sum(self._charges(better, charge_s))
        return any_found

    def another(self, charge_s: list[float], budget: TimeBudget) -> Solution | None:
        """A cheap sequence with other charges, if one is found quickly."""
        self._quick = self._quick or Relaxation(self.task, additive=False, labels=1)
        found = Search(self.task, self._quick, charge_s, 1.0).run(budget, OTHER_STATES)
        return found if isinstance(found, Solution) else None

    def _charges(self, found: Solution, charge_s: list[float]) -> Iterator[float]:
        numbers = {id(operator.action): n for n, operator in enumerate(self.task.operators)}
        for action in found.actions:
            if (number := numbers.get(id(action))) is not None:
                yield charge_s[number]
            else:
                key = action.actor, str(action.after[0].value)
                yield self.task.travel.charges_s.get(key, 0.0)


def _unfinished(search: Search, task: FiniteDomainTask) -> Unfinished:
    steps = search.nearest[1].steps
    return Unfinished(tuple(task.operators[number].action for number in steps), search.states)
