"""Action sequences that reach one subgoal, or that look for what it needs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from msgspec import structs

from fleet.core.model.derived import carriers, is_closed
from fleet.core.model.formulas.nodes import Formula
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, capacity, condition_holds, room_left
from fleet.jobshop.time_budget import OutOfTime, TimeBudget
from fleet.planners.base import PlanningProblem
from fleet.planners.deordering import ActionSequence
from fleet.planners.symbolic.engine.alternatives import Quorum
from fleet.planners.symbolic.engine.constraints import ANYHOW, Trajectory
from fleet.planners.symbolic.engine.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.engine.grounding import Grounding
from fleet.planners.symbolic.engine.impossibility import what_is_missing
from fleet.planners.symbolic.engine.instantiation import Facts
from fleet.planners.symbolic.engine.relaxation import least_dear
from fleet.planners.symbolic.engine.robot_classes import representatives
from fleet.planners.symbolic.engine.search import Solution, Solver, Unfinished, Unreachable
from fleet.planners.symbolic.engine.travel import Travel
from fleet.planners.symbolic.engine.wanted import Breadth
from keyexpr_schema.facts import AT, HELD, HOLDING, SEARCHED, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition

ALTERNATIVES = 4
"""Different sequences sought for each condition."""
UNLOADING_S = 30.0
"""What it counts for, in seconds, that an object ends in a basket and not on a table: somebody
still has to take it out, which is about one more task for a hand."""
CLOSED = "openable & contains"
"""What things may be in that are not seen from outside."""
NEAREST_STEPS = 4
"""Steps named of those that a search still lacked when it gave up."""
REUSE_CHARGE_S = 200.0
"""What an action costs more for each sequence that already uses it, and as much again for each that
uses its skill for the same things; more than any task takes."""


@dataclass(frozen=True)
class Subgoal:
    """One condition of one goal; or with `others` several, to be reached at once."""

    goal: str
    condition: Condition
    others: tuple[Condition, ...] = ()

    def __str__(self) -> str:
        return " and ".join(map(str, (self.condition, *self.others)))

    def choices(self, world: WorldModel) -> list[tuple[Condition, ...]]:
        """The conditions for each of those for whom the first may hold; the others are for the
        same where they may be, or for one of whom it is known where they are, and for somebody
        else where one thing cannot be both.
        """
        choices = []
        for subject in self.condition.subjects:
            rows = [structs.replace(self.condition, subject=subject, any_of=())]
            for other in self.others:
                said = {row.subject for row in rows if row.relation == other.relation}
                free = [s for s in other.subjects if s not in said] or other.subjects
                known = (s for s in free if world.value(AT, s) is not None)
                one = subject if subject in free else next(known, free[0])
                rows.append(structs.replace(other, subject=one, any_of=()))
            choices.append(tuple(rows))
        return choices


@dataclass(frozen=True)
class Impossible:
    """There is no sequence for a subgoal; what is missing first, as a sentence, and the things that
    would have to be found first.
    """

    reason: str
    unlocated: tuple[str, ...] = ()


@dataclass(frozen=True)
class GaveUp:
    """No sequence was found in time; how near it came, as a sentence."""

    reason: str


@dataclass(frozen=True)
class Exploration:
    """Action sequences that are all needed to find one of `seeks`, and what they make true."""

    sequences: tuple[ActionSequence, ...]
    conditions: tuple[Condition, ...]
    seeks: tuple[str, ...]


def subgoals_in_order(problem: PlanningProblem, facts: Mapping[FactKey, Value]) -> list[Subgoal]:
    """Conditions that do not hold in `facts`: first those whose object a hand holds already, last
    those that leave an object in a hand; of each, those for one of several after the others.
    """
    held = {facts.get(FactKey(HOLDING, robot)) for robot in problem.world.team}
    subgoals = [
        Subgoal(goal.goal, condition)
        for goal in sorted(problem.goals, key=lambda g: (-g.priority, g.ordinal, g.goal))
        for condition in goal.conditions
        if not condition_holds(facts, condition, problem.world)
    ]
    return sorted(
        subgoals,
        key=lambda subgoal: (
            subgoal.condition.relation == HELD,
            held.isdisjoint(subgoal.condition.subjects),
            bool(subgoal.condition.any_of),
        ),
    )


def alternatives_for(
    subgoal: Subgoal,
    facts: Facts,
    world: WorldModel,
    budget: TimeBudget,
    on_the_way: Trajectory = ANYHOW,
    patient: bool = False,
) -> tuple[tuple[ActionSequence, ...], Facts] | Impossible | GaveUp:
    """Different sequences for a subgoal, the cheapest first, and the facts after that one; or why
    there is none, or none was found within the `budget`.

    Where a robot stands is left open at the start, so that every actor begins with the way to its
    work, whatever its robot does before. What has to hold, or not, `on_the_way` does so in every
    state of a sequence. If `patient`, more time is spent on finding the cheapest.
    """
    failures: list[Impossible | GaveUp] = []
    sought: list[_Sought] = []
    for conditions in subgoal.choices(world):
        made = _sought(conditions, facts, world, budget, on_the_way)
        if isinstance(made, _Sought):
            sought.append(made)
        else:
            failures.append(made)
    sought.sort(key=lambda one: one.least_s)
    found: list[tuple[Solution, _Sought]] = []
    for one in sought:
        if len(found) >= ALTERNATIVES and one.least_s >= _dearest_s(found):
            break
        results = _different_solutions(one, budget, patient)
        while not results and one.wider is not None:
            again = _sought(one.conditions, facts, world, budget, on_the_way, one.wider)
            if not isinstance(again, _Sought):
                failures += [again] if isinstance(again, GaveUp) else []
                break
            one = again
            results = _different_solutions(one, budget, patient)
        if isinstance(results, Unfinished):
            failures.append(GaveUp(_gave_up(subgoal, results, budget)))
            break
        found += [(result, one) for result in results]
    if not found:
        return _failure(subgoal, failures, facts, world)
    found.sort(key=lambda pair: pair[0].cost_s + _unloading_s(pair[0], pair[1], world))
    sequences: dict[object, ActionSequence] = {}
    for result, one in found:
        named = frozenset(world.robots) & _spoken_of(one.conditions, world)
        sequence = ActionSequence(subgoal.goal, result.actions, named)
        sequences.setdefault(sequence.lifted, sequence)
    after = found[0][0].facts
    unmoved = (key for key, value in after.items() if value is None and key.relation == AT)
    return tuple(sequences.values())[:ALTERNATIVES], {**after, **{k: facts.get(k) for k in unmoved}}


def _failure(
    subgoal: Subgoal,
    failures: Sequence[Impossible | GaveUp],
    facts: Facts,
    world: WorldModel,
) -> Impossible | GaveUp:
    """Why there is no sequence for any of those for whom a subgoal may hold."""
    for failure in failures:
        if isinstance(failure, GaveUp):
            return failure
    impossible = [failure for failure in failures if isinstance(failure, Impossible)]
    if not impossible:
        return Impossible(_full(subgoal, facts, world) or _exhausted(subgoal))
    lost = dict.fromkeys(thing for failure in impossible for thing in failure.unlocated)
    return replace(impossible[0], unlocated=tuple(lost))


def _spoken_of(conditions: Sequence[Condition], world: WorldModel) -> frozenset[object]:
    """What the conditions speak of; what rides in a basket already rides with a certain robot."""
    return frozenset(
        name
        for condition in conditions
        for name in (condition.subject, condition.value, world.value(AT, condition.subject))
    )


def _dearest_s(found: Sequence[tuple[Solution, _Sought]]) -> float:
    return sorted(solution.cost_s for solution, _ in found)[ALTERNATIVES - 1]


def _gave_up(subgoal: Subgoal, search: Unfinished, budget: TimeBudget) -> str:
    """How near a search came that ran out of time, or of states."""
    after = f"{budget.seconds:.3g} s" if budget.over else f"{search.states} states"
    steps = [f"{a.skill.name}({', '.join(a.args.values())})" for a in search.nearest]
    rest = f"still lacked {', '.join(steps[:NEAREST_STEPS])}" if steps else "is where it began"
    more = f" and {len(steps) - NEAREST_STEPS} more" if len(steps) > NEAREST_STEPS else ""
    return f"gave up after {after}; the nearest it came to {subgoal} {rest}{more}"


def _full(subgoal: Subgoal, facts: Facts, world: WorldModel) -> str | None:
    """Which of those that are to carry something has no room left, and for what that is."""
    for condition in (subgoal.condition, *subgoal.others):
        name = condition.value
        if name not in world.objects or room_left(str(name), facts, world) > 0:
            continue
        there = [thing for thing in world.objects if facts.get(FactKey(AT, thing)) == name]
        taken = f", taken up by {', '.join(there)}" if there else ""
        return f"{name} has room for {capacity(str(name), world):g}{taken}"
    return None


def _exhausted(subgoal: Subgoal) -> str:
    return (
        f"every way to {subgoal} undoes something that it needs: all states that the connected "
        "robots can reach were looked at"
    )


def _unloading_s(found: Solution, sought: _Sought, world: WorldModel) -> float:
    """The charge for objects that end in a basket."""
    charge_s = 0.0
    for condition in sought.conditions:
        around = carriers(condition.subject, found.facts.get, world, aboard=True)
        robots = [carrier for carrier in around if carrier in world.robots]
        wanted = condition.value in robots or condition.relation == HELD
        charge_s += 0.0 if wanted or not robots else UNLOADING_S
    return charge_s


@dataclass(frozen=True)
class _Sought:
    """Conditions of one subject each, as a task, and at least what it costs [s]."""

    conditions: tuple[Condition, ...]
    task: FiniteDomainTask
    solver: Solver
    least_s: float
    wider: Breadth | None
    """How to look again where this leads nowhere; `None` if all was looked at."""


def _different_solutions(
    sought: _Sought, budget: TimeBudget, patient: bool
) -> list[Solution] | Unfinished:
    """The cheapest sequence, and others made different by charging for what was used before."""
    charge_s = [0.0] * len(sought.task.operators)
    same: dict[object, list[int]] = {}
    world = sought.task.world
    for number, operator in enumerate(sought.task.operators):
        for use in _uses(operator.action, world):
            same.setdefault(use, []).append(number)
    found: Solution | Unreachable | Unfinished | None = sought.solver.solve(
        charge_s, budget, patient
    )
    if isinstance(found, Unfinished):
        return found
    solutions: list[Solution] = []
    while isinstance(found, Solution):
        solutions.append(found)
        if len(solutions) == ALTERNATIVES:
            break
        for action in found.actions:
            for use in _uses(action, world):
                for number in same.get(use, ()):
                    charge_s[number] += REUSE_CHARGE_S
        found = sought.solver.another(charge_s, budget)
    return solutions


def _uses(action: Action, world: WorldModel) -> tuple[object, object]:
    """What is charged for when an action was used: it, whichever robot does it; and the skill for
    the same things wherever, so that another way to go about it comes before another place.
    """
    skill = action.skill
    args = [v for name, v in action.args.items() if name not in skill.robot_parameters]
    anywhere = (value for value in args if value not in world.places)
    return (skill.name, *args), (skill.name, None, *anywhere)


def _sought(
    conditions: tuple[Condition, ...],
    facts: Facts,
    world: WorldModel,
    budget: TimeBudget,
    on_the_way: Trajectory,
    breadth: Breadth = Breadth.NARROW,
) -> _Sought | Impossible | GaveUp:
    """The conditions as a task, or why they are out of reach, even with more alternatives and with
    detours if those can help and there is time for them."""
    goal = [Literal(FactKey(c.relation, c.subject), c.value) for c in conditions]
    way = (*on_the_way.always, *on_the_way.avoided)
    robots = representatives(conditions, facts, world, way, breadth is Breadth.THOROUGH)
    travel = Travel(world, facts)
    free = {robot: facts.get(FactKey(AT, robot)) for robot in sorted(travel.free(robots))}
    start = {**facts, **{FactKey(AT, robot): None for robot in free}}
    chosen: dict[Quorum, Collection[Formula]] = {}
    try:
        while True:
            grounding = Grounding(world, start, goal, robots, free, breadth, budget, chosen)
            task = FiniteDomainTask(
                world, start, goal, grounding.actions, robots, travel, free, on_the_way, budget
            )
            if not grounding.undecided.keys() - chosen.keys():
                break
            chosen |= least_dear(grounding.undecided, task)
    except OutOfTime:
        return GaveUp(
            f"gave up after {budget.seconds:.3g} s, while what can be done for "
            f"{' and '.join(map(str, conditions))} was still being worked out"
        )
    solver = Solver(task)
    least_s = inf if task.impossible else solver.least_s()
    if least_s < inf:
        return _Sought(conditions, task, solver, least_s, grounding.wider)
    missing = what_is_missing(grounding, task)
    if missing.certain or grounding.wider is None:
        return Impossible(missing.phrase, missing.unlocated)
    return _sought(conditions, facts, world, budget, on_the_way, grounding.wider)


def exploration_for(
    seeks: tuple[str, ...], goal: str, problem: PlanningProblem, budget: TimeBudget
) -> Exploration | None:
    """Looking around in every place where nobody has looked yet, for all that is sought; when that
    is done, into everything that is closed. It is said to be for one of the goals.

    `None` where nothing is left to look for, or nobody can look. Places that the `budget` does not
    suffice for are left to a later revision.
    """
    world = problem.world
    closed = [name for name in world.of_type(CLOSED) if is_closed(name, world.facts.get, world)]
    # What would be behind others once those are open comes before them: no need to close any.
    closed.sort(key=lambda name: len(world.objects[name].blocked_by), reverse=True)
    return _looked_into(world.places, seeks, goal, problem, budget) or _looked_into(
        closed, seeks, goal, problem, budget
    )


def _looked_into(
    spots: Iterable[str],
    seeks: tuple[str, ...],
    goal: str,
    problem: PlanningProblem,
    budget: TimeBudget,
) -> Exploration | None:
    """Looking around in places, or into things, where nobody has looked yet."""
    facts: Facts = dict(problem.world.facts)
    sequences: list[ActionSequence] = []
    conditions: list[Condition] = []
    for place in spots:
        if place in problem.searched:
            continue
        facts[FactKey(SEARCHED, place)] = False
        condition = Condition(relation=SEARCHED, subject=place, value=True)
        found = alternatives_for(Subgoal(goal, condition), facts, problem.world, budget)
        if isinstance(found, tuple):
            looked, facts = found
            sequences.append(looked[0])
            conditions.append(condition)
    return Exploration(tuple(sequences), tuple(conditions), seeks) if sequences else None
