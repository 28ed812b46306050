"""The least makespan of a small scene by CP-SAT, to hold plans against.

A thing is carried by one hand all the way; or a hand puts it into a basket where it lies, the
carrier drives, and there it stays in the basket or another (or the same) hand takes it out and
puts it down. Hands take and put one thing at a time. What this leaves out, such as meeting half
way, or two carriers one after the other, can only make the true optimum smaller.

Each robot's visits are a circuit (Dantzig, Fulkerson and Johnson 1954) with travel times on its
arcs; what lies in a basket takes part of its room from loading to unloading.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from ortools.sat.python import cp_model

from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.goals import Goal

TICKS_PER_S = 10
"""CP-SAT counts in whole numbers: tenths of a second."""


@dataclass(frozen=True)
class Optimum:
    """The least makespan found, with what counts for full baskets, and a proven lower bound [s]."""

    makespan_s: float
    bound_s: float

    @property
    def proven(self) -> bool:
        """Whether there is no shorter one."""
        return self.makespan_s - self.bound_s < 1.0 / TICKS_PER_S


Timed = tuple[cp_model.IntVar, cp_model.IntVar, cp_model.IntVar]
"""Whether it is done, from when and until when."""


@dataclass(frozen=True)
class _Visit:
    """Something that a robot may do: from where to where, and when."""

    origin: str
    target: str
    start: cp_model.IntVar
    end: cp_model.IntVar
    present: cp_model.IntVar
    absent: cp_model.IntVar


@dataclass
class _Model:
    world: WorldModel
    horizon: int
    cp: cp_model.CpModel = field(default_factory=cp_model.CpModel)
    visits: dict[str, list[_Visit]] = field(default_factory=lambda: defaultdict(list))
    aboard: dict[str, list[cp_model.IntervalVar]] = field(default_factory=lambda: defaultdict(list))
    endings: list[tuple[str, _Visit]] = field(default_factory=list)
    """Arrivals after which the carrier stays where it is, and a thing in its basket."""

    def ticks(self, seconds: float) -> int:
        return round(seconds * TICKS_PER_S)

    def work(self, robot: str, skill: str) -> int:
        return self.ticks(self.world.work_s(robot, self.world.skills[skill]))

    def way(self, robot: str, origin: str, target: str) -> int:
        if origin == target:
            return 0
        return self.work(robot, "navigate") + self.ticks(self.world.travel_s(robot, origin, target))

    def time(self, name: str) -> cp_model.IntVar:
        return self.cp.new_int_var(0, self.horizon, name)

    def visit(
        self,
        robot: str,
        origin: str,
        target: str,
        least: int,
        present: cp_model.IntVar,
        name: str,
        exactly: bool = True,
    ) -> _Visit:
        """One more thing to do for a robot; it may take longer than `least` if not `exactly`."""
        start, end = self.time(f"{name} from"), self.time(f"{name} to")
        if exactly:
            self.cp.add(end == start + least)
        else:
            self.cp.add(end >= start + least)
        absent = self.cp.new_bool_var(f"{name} not")
        self.cp.add(absent + present == 1)
        made = _Visit(origin, target, start, end, present, absent)
        self.visits[robot].append(made)
        return made

    def in_some_order(self, robot: str, at: str) -> None:
        """The robot's visits follow each other, with the ways between them."""
        rows, arcs = self.visits[robot], []
        for j, visit in enumerate(rows, start=1):
            first = self.cp.new_bool_var(f"{robot} first {j}")
            self.cp.add(visit.start >= self.way(robot, at, visit.origin)).only_enforce_if(first)
            arcs += [(0, j, first), (j, 0, self.cp.new_bool_var(f"{robot} last {j}"))]
            arcs.append((j, j, visit.absent))
            for k, other in enumerate(rows, start=1):
                if k == j:
                    continue
                then = self.cp.new_bool_var(f"{robot} {j} then {k}")
                way = self.way(robot, visit.target, other.origin)
                self.cp.add(other.start >= visit.end + way).only_enforce_if(then)
                arcs.append((j, k, then))
        if rows:
            arcs.append((0, 0, self.cp.new_bool_var(f"{robot} idle")))
            self.cp.add_circuit(arcs)


def least_makespan(
    world: WorldModel, goals: Sequence[Goal], left_in_basket_s: float = 0.0, limit_s: float = 60.0
) -> Optimum | None:
    """The least makespan in which every thing comes to its place; `None` if none was found.

    Each thing that is left in a basket counts for `left_in_basket_s` more. Each goal is one
    condition `at(thing) = place`; hands and baskets are empty at the start.
    """
    hands = [r for r in world.team if "pick" in world.robots[r].skills]
    carriers = [r for r in world.team if world.capability(r, "basket")]
    model = _Model(world, horizon=_horizon(world, goals, hands))
    makespan = model.time("makespan")
    for goal in goals:
        (condition,) = goal.conditions
        thing, target = condition.subject, str(condition.value)
        ways = _ways(model, thing, str(world.value(AT, thing)), target, hands, carriers, makespan)
        model.cp.add_exactly_one(ways)
    for carrier in carriers:
        room = int(world.capability(carrier, "basket") or 0)
        rows = model.aboard[carrier]
        model.cp.add_cumulative(rows, [1] * len(rows), room)
    for carrier, arrival in model.endings:
        for visit in model.visits[carrier]:
            if visit.target != arrival.origin:
                model.cp.add(visit.end <= arrival.start).only_enforce_if(
                    visit.present, arrival.present
                )
    for robot in (*hands, *carriers):
        model.in_some_order(robot, str(world.facts[FactKey(AT, robot)]))
    left = model.ticks(left_in_basket_s) * sum(arrival.present for _, arrival in model.endings)
    model.cp.minimize(makespan + left)
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = limit_s
    solver.parameters.num_workers = 2
    if solver.solve(model.cp) not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return None
    return Optimum(solver.objective_value / TICKS_PER_S, solver.best_objective_bound / TICKS_PER_S)


def _horizon(world: WorldModel, goals: Sequence[Goal], hands: Sequence[str]) -> int:
    """One slow hand brings everything, one after the other, from the farthest away [ticks]."""
    sizing = _Model(world, horizon=0)
    longest = max(
        sizing.way(hand, a, b) for hand in hands for a, b in product(world.places, repeat=2)
    )
    each = max(sizing.work(h, "pick") + sizing.work(h, "place") for h in hands)
    return len(goals) * (each + 2 * longest)


def _ways(
    model: _Model,
    thing: str,
    origin: str,
    target: str,
    hands: Sequence[str],
    carriers: Sequence[str],
    makespan: cp_model.IntVar,
) -> list[cp_model.IntVar]:
    """The ways to bring one thing: whether each is taken."""
    cp, ways = model.cp, []
    for hand in hands:
        by_hand = cp.new_bool_var(f"{thing} by {hand}")
        takes = model.work(hand, "pick") + model.way(hand, origin, target)
        takes += model.work(hand, "place")
        brought = model.visit(hand, origin, target, takes, by_hand, f"{thing} {hand}")
        cp.add(makespan >= brought.end).only_enforce_if(by_hand)
        ways.append(by_hand)
    for carrier in carriers:
        rides = cp.new_bool_var(f"{thing} rides {carrier}")
        ways.append(rides)
        loads = [_loaded(model, thing, origin, hand, carrier) for hand in hands]
        cp.add(_total(loads) == 1).only_enforce_if(rides)
        cp.add(_total(loads) == 0).only_enforce_if(~rides)
        stays = cp.new_bool_var(f"{thing} stays in {carrier}")
        arrival = model.visit(carrier, target, target, 0, stays, f"{thing} arrives {carrier}")
        model.endings.append((carrier, arrival))
        cp.add(makespan >= arrival.end).only_enforce_if(stays)
        unloads: list[Timed] = []
        for hand in hands:
            if "pick_from_robot" in model.world.robots[hand].skills:
                unloads.append(_unloaded(model, thing, target, hand, carrier, makespan))
        cp.add(_total(unloads, stays) == 1).only_enforce_if(rides)
        cp.add(_total(unloads, stays) == 0).only_enforce_if(~rides)
        for by, load_start, load_end in loads:
            cp.add(makespan >= load_end).only_enforce_if(by)
            cp.add(arrival.start >= load_end).only_enforce_if(by, stays)
            _aboard(model, carrier, load_start, model.horizon, [by, stays])
            for out, out_start, out_end in unloads:
                cp.add(out_start >= load_end).only_enforce_if(by, out)
                _aboard(model, carrier, load_start, out_end, [by, out])
    return ways


def _aboard(
    model: _Model,
    carrier: str,
    start: cp_model.IntVar,
    end: cp_model.IntVar | int,
    when: Sequence[cp_model.IntVar],
) -> None:
    both = model.cp.new_bool_var("aboard")
    model.cp.add_bool_and(when).only_enforce_if(both)
    model.cp.add_bool_or([*(~one for one in when), both])
    size = model.time("aboard for")
    model.aboard[carrier].append(
        model.cp.new_optional_interval_var(start, size, end, both, "aboard")
    )


def _total(rows: Sequence[Timed], *more: cp_model.IntVar) -> Any:
    """How many of them are done, and of `more`."""
    return cp_model.LinearExpr.sum([*more, *(by for by, _, _ in rows)])


def _loaded(model: _Model, thing: str, origin: str, hand: str, carrier: str) -> Timed:
    """A hand takes a thing and puts it into the basket beside it; they may wait in between."""
    by = model.cp.new_bool_var(f"{thing} {hand} loads {carrier}")
    takes, puts = model.work(hand, "pick"), model.work(hand, "place_on_robot")
    name = f"{thing} {hand} {carrier}"
    whole = model.visit(hand, origin, origin, takes + puts, by, name, exactly=False)
    load = model.visit(carrier, origin, origin, puts, by, f"{name} load")
    model.cp.add(load.end == whole.end).only_enforce_if(by)
    return by, load.start, load.end


def _unloaded(
    model: _Model, thing: str, target: str, hand: str, carrier: str, makespan: cp_model.IntVar
) -> Timed:
    """A hand takes a thing out of a basket and puts it down beside it."""
    by = model.cp.new_bool_var(f"{thing} {hand} unloads {carrier}")
    takes, puts = model.work(hand, "pick_from_robot"), model.work(hand, "place")
    name = f"{thing} {hand} {carrier} out"
    whole = model.visit(hand, target, target, takes + puts, by, name)
    out = model.visit(carrier, target, target, takes, by, f"{name} taken")
    model.cp.add(out.start == whole.start).only_enforce_if(by)
    model.cp.add(makespan >= whole.end).only_enforce_if(by)
    return by, out.start, out.end
