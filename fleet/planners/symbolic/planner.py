"""The symbolic planner: finds plans by search over skill models, with no network.

Every condition of every goal is a subgoal. For each, several different action sequences that reach
it are sought (for instance one with a helper that carries), and one is chosen as the strategy says:

* `big-dag` chooses for all goals together, by the makespan that they lead to;
* `per-goal` chooses for each goal alone, as if there were no other, and merges the results;
* `monolithic` makes one flat list, each goal going on from where the one before left every robot.

Where it is not known where a needed object is, the plan looks for it: a search of every place, by
all robots that can, in parallel. What is found leads to the next revision.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from itertools import cycle, product
from math import inf, prod

from fleet.core.actors import carried_at_end
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.model.derived import is_located
from fleet.core.model.world import WorldModel, condition_holds
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, NoPlan, Planner, PlanningProblem
from fleet.planners.deordering import ActionSequence, deordered
from fleet.planners.symbolic.action_sequences import (
    UNLOADING_S,
    Exploration,
    GaveUp,
    Impossible,
    Subgoal,
    alternatives_for,
    exploration_for,
    subgoals_in_order,
)
from fleet.planners.symbolic.instantiation import Facts
from fleet.scheduling.plan_schedule import AllocatedPlan, PlanSchedule
from fleet.scheduling.quick_allocation import quick_allocation
from keyexpr_schema.payloads.plans import Plan

MAX_COMBINATIONS = 256
"""Up to this many combinations are all compared; beyond, one sequence is changed at a time."""
MOST_REFINED, REFINING_NODES = 12, 3000
"""Of those, how many of the most promising get a better allocation, and how long it is sought."""
MAX_RESTORATIONS = 2
"""How often what the sequences for later subgoals undid is reached again, where no plan does."""

SEARCH_SHARE = 0.6
"""Of the time for planning, how much the search for sequences has; choosing takes the rest."""

Choice = Sequence[ActionSequence]
Cost = tuple[float, float]
"""The makespan [s], with a charge for what is left in baskets, and the work of all robots [s]."""


class SymbolicPlanner(Planner):
    """Search over skill models."""

    name = "symbolic"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC)

    def _solve(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        made = self._one_by_one(problem)
        if isinstance(made, CheckedPlan) or made.postponed:
            return made
        if not any(len(goal.conditions) > 1 for goal in problem.goals):
            return made
        together = self._each_goal_at_once(problem)
        return together if isinstance(together, CheckedPlan) or together.postponed else made

    def _each_goal_at_once(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        """All conditions of a goal in one search: what one of them leaves in a hand is there for
        the next, and what is undone on the way is made true again.
        """
        reached = _Reached(problem, dict(problem.world.facts), problem.budget.until(SEARCH_SHARE))
        for goal in problem.goals:
            if all(condition_holds(reached.facts, c, problem.world) for c in goal.conditions):
                continue
            first, *others = goal.conditions
            if not reached.add(Subgoal(goal.goal, first, tuple(others))):
                failure = reached.failure
                return NoPlan(failure.reason, postponed=isinstance(failure, GaveUp))
        return _choose(problem, reached.options, None)

    def _one_by_one(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        """One search for each condition of each goal."""
        world = problem.world
        searching = problem.budget.until(SEARCH_SHARE)
        reached = _Reached(problem, dict(world.facts), searching)
        unlocated: list[Subgoal] = []
        late: set[str] = set()
        for subgoal in subgoals_in_order(problem, world.facts):
            if not searching.over and reached.add(subgoal):
                continue
            if searching.over or isinstance(reached.failure, GaveUp):
                late.add(subgoal.goal)
            elif _needs_locating(subgoal, reached.facts, world):
                unlocated.append(subgoal)
            else:
                return NoPlan(_no_way(subgoal, reached.failure, world))
        if late and len(problem.goals) == 1 and isinstance(reached.failure, GaveUp):
            return NoPlan(reached.failure.reason, postponed=True)
        if late:
            return _in_time(problem, reached.options, unlocated, late)
        explored = exploration_for(unlocated, problem, searching) if unlocated else None
        if unlocated and explored is None:
            if searching.over:
                return NoPlan(problem.not_in_time, postponed=True)
            return NoPlan(_not_found(unlocated[0], problem))
        made = _choose(problem, reached.options, explored)
        for _ in range(MAX_RESTORATIONS):
            if problem.budget.over:
                break
            undone = [s for s in subgoals_in_order(problem, reached.facts) if s not in unlocated]
            if isinstance(made, CheckedPlan) or not (undone and all(map(reached.add, undone))):
                break
            restored = _choose(problem, reached.options, explored)
            made = restored if isinstance(restored, CheckedPlan) else made
        if isinstance(made, NoPlan) and problem.budget.over:
            return replace(made, postponed=True)  # not all choices were looked at
        return made


@dataclass
class _Reached:
    """Action sequences for one subgoal after the other, and the facts after the cheapest of each.

    Robots of a flat list are `settled`: they start from where the sequence before left them.
    """

    problem: PlanningProblem
    facts: Facts
    budget: TimeBudget
    options: list[Choice] = field(default_factory=list)
    settled: set[str] = field(default_factory=set)
    failure: Impossible | GaveUp = field(default_factory=lambda: Impossible("nothing was sought"))

    def add(self, subgoal: Subgoal) -> bool:
        """Find sequences that reach one more subgoal; whether there are any."""
        settled = frozenset(self.settled)
        found = alternatives_for(subgoal, self.facts, self.problem.world, self.budget, settled)
        if not isinstance(found, tuple):
            self.failure = found
            return False
        sequences, self.facts = found
        self.options.append(sequences)
        if self.problem.strategy == MONOLITHIC:
            for action in sequences[0].actions:
                self.settled.update(action.participants)
        return True


def _in_time(
    problem: PlanningProblem,
    options: Sequence[Choice],
    unlocated: Sequence[Subgoal],
    late: Set[str],
) -> CheckedPlan | NoPlan:
    """A plan for those goals for which everything was found before the time was over."""
    late = late | {subgoal.goal for subgoal in unlocated}
    goals = tuple(goal for goal in problem.goals if goal.goal not in late)
    found = [sequences for sequences in options if sequences[0].goal not in late]
    none = NoPlan(problem.not_in_time, postponed=True)
    if not found:
        return none
    made = _choose(replace(problem, goals=goals), found, None)
    # What was found for a goal may need what was found for one that is late.
    return made if isinstance(made, CheckedPlan) else none


def _needs_locating(subgoal: Subgoal, facts: Facts, world: WorldModel) -> bool:
    return any(
        subject in world.objects and not is_located(subject, facts.get, world)
        for subject in subgoal.condition.subjects
    )


def _no_way(subgoal: Subgoal, why: Impossible | GaveUp, world: WorldModel) -> str:
    failed = (f"; {known.robot} cannot {known.skill}: {known.reason}" for known in world.hopeless)
    return (
        f"no sequence of skills of the connected robots ({', '.join(world.team)}) "
        f"leads to {subgoal}: {why.reason}{''.join(failed)}"
    )


def _not_found(subgoal: Subgoal, problem: PlanningProblem) -> str:
    things = " or ".join(subgoal.condition.subjects)
    if problem.searched:
        places = ", ".join(sorted(problem.searched))
        return f"nobody knows where {things} is; looked for in {places}, and not found"
    return (
        f"nobody knows where {things} is, and no connected robot "
        f"({', '.join(problem.world.team)}) can look for it"
    )


@dataclass(frozen=True)
class _Candidate:
    """A valid plan for a choice of sequences, each actor with the able robot that has least to do.

    Until it is verified, `cost` is that of the shortest schedule, which need not pass the checker.
    """

    choice: Choice
    allocated: AllocatedPlan
    cost: Cost

    def refined(self) -> _Candidate:
        """With a better allocation, if a look at all of a small plan's finds one."""
        checked = self.allocated.checked
        made = _allocated(self.choice, checked, quick_allocation(checked, REFINING_NODES))
        return made if made is not None and made.cost < self.cost else self

    def verified(self) -> _Candidate | NoPlan:
        """With the cost of the shortest schedule that passes the checker."""
        found = self.allocated.valid_schedule()
        if isinstance(found, tuple):
            return NoPlan(found[0].sentence, found)
        return replace(self, cost=_cost(found, self.allocated.checked))


def _cost(schedule: PlanSchedule, checked: CheckedPlan) -> Cost:
    unloading_s = UNLOADING_S * len(carried_at_end(checked))
    return round(schedule.makespan_s + unloading_s, 3), sum(schedule.durations_s.values())


def _choose(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> CheckedPlan | NoPlan:
    best: _Candidate | NoPlan | None = None
    if problem.strategy == MONOLITHIC:
        best = _best(problem, [alternatives[:1] for alternatives in options], explored)
    elif problem.strategy == PER_GOAL:
        choice: list[Choice] = []
        for goal in dict.fromkeys(alternatives[0].goal for alternatives in options):
            mine = [alternatives for alternatives in options if alternatives[0].goal == goal]
            alone = _best(problem, mine, None)
            if isinstance(alone, NoPlan) or problem.budget.over:
                break
            choice += [(sequence,) for sequence in alone.choice]
        else:
            best = _best(problem, choice, explored)
        # What is best for each goal alone may not fit together, as where two want one helper.
        best = best if isinstance(best, _Candidate) else None
    best = best or _best(problem, options, explored)
    return best if isinstance(best, NoPlan) else best.allocated.checked


def _best(
    problem: PlanningProblem, options: Sequence[Choice], explored: Exploration | None
) -> _Candidate | NoPlan:
    """The cheapest candidate: of few combinations the cheapest of all; else from the cheapest
    sequence of each, one is changed at a time for as long as that helps.

    When the time is over it is the cheapest of those looked at until then, at least one.
    """
    best: _Candidate | None = None
    failure: NoPlan | None = None

    def better(found: _Candidate | NoPlan) -> bool:
        nonlocal best, failure
        # Verifying does not make a plan cheaper: only what looks cheaper is verified.
        if isinstance(found, _Candidate) and (best is None or found.cost < best.cost):
            found = found.verified()
            if isinstance(found, _Candidate) and (best is None or found.cost < best.cost):
                best = found
                return True
        failure = found if failure is None and isinstance(found, NoPlan) else failure
        return False

    def candidate(choice: Choice) -> _Candidate | NoPlan:
        return _candidate(problem, choice, explored)

    if prod(map(len, options)) <= MAX_COMBINATIONS:
        candidates: list[_Candidate | NoPlan] = []
        for choice in product(*options):
            candidates.append(candidate(choice))
            if problem.budget.over:
                break
        candidates.sort(key=_promise)
        for number, found in enumerate(candidates[:MOST_REFINED]):
            if problem.budget.over:
                break
            if isinstance(found, _Candidate):
                candidates[number] = found.refined()
        any_valid = False
        for found in sorted(candidates, key=_promise):
            if any_valid and problem.budget.over:
                break
            any_valid |= better(found)
    else:
        current = [alternatives[0] for alternatives in options]
        better(candidate(current))
        unchanged = 0
        for number, alternatives in cycle(enumerate(options)):
            if unchanged == len(options):
                break
            unchanged += 1
            for sequence in alternatives:
                changed = [*current[:number], sequence, *current[number + 1 :]]
                if problem.budget.over:
                    break
                if changed != current and better(candidate(changed)):
                    current, unchanged = changed, 1
    return best or failure or NoPlan("no combination of action sequences passes the checker")


def _promise(found: _Candidate | NoPlan) -> Cost:
    return (-inf, -inf) if isinstance(found, NoPlan) else found.cost


def _candidate(
    problem: PlanningProblem, choice: Choice, explored: Exploration | None
) -> _Candidate | NoPlan:
    checked = check_plan(_plan(problem, choice, explored), problem.world)
    if isinstance(checked, InvalidPlan):
        return NoPlan(checked.violations[0].sentence, checked.violations)
    made = _allocated(choice, checked, quick_allocation(checked))
    return made or NoPlan("there are fewer robots than the plan needs at the same time")


def _allocated(
    choice: Choice, checked: CheckedPlan, allocation: Mapping[str, str] | None
) -> _Candidate | None:
    if allocation is None:
        return None
    allocated = AllocatedPlan(checked, allocation)
    schedule = next(allocated.schedules(), None)
    cost = (inf, inf) if schedule is None else _cost(schedule, checked)
    return _Candidate(choice, allocated, cost)


def _plan(problem: PlanningProblem, choice: Choice, explored: Exploration | None) -> Plan:
    """The plan of these sequences; it promises the conditions of goals that have one."""
    sequences = [*choice, *(explored.sequences if explored else ())]
    tasks, pins = deordered(
        sequences,
        problem.first_task,
        one_actor_each=problem.strategy == MONOLITHIC,
        world=problem.world,
    )
    seeks = frozenset(explored.seeks if explored else ())
    served = {sequence.goal for sequence in choice}
    conditions = tuple(
        condition
        for goal in problem.goals
        for condition in goal.conditions
        if seeks.isdisjoint(condition.subjects)
        and (goal.goal in served or problem.world.holds(condition))
    )
    return Plan(
        plan=problem.plan,
        revision=problem.revision,
        goals=tuple(goal.goal for goal in problem.goals),
        conditions=(*conditions, *(explored.conditions if explored else ())),
        tasks=tasks,
        pins=pins,
        strategy=problem.strategy,
        made_by="symbolic",
        allocator=problem.allocator,
        seeks=tuple(explored.seeks) if explored else (),
    )
