"""The symbolic planner: finds plans by search over skill models, with no network.

Every condition of every goal is a subgoal. For each, several different action sequences that reach
it are sought (for instance one with a helper that carries), and one is chosen as the strategy says:

* `big-dag` chooses for all goals together, by the makespan that they lead to;
* `per-goal` chooses for each goal alone, as if there were no other, and merges the results;
* `monolithic` makes one flat list, each goal going on from where the one before left every robot
  (`flat_list`);
* `least-work` searches for all conditions of a goal at once, and chooses by what the robots have to
  do altogether, however long that takes.

Where it is not known where a needed object is, the plan looks for it: a search of every place, by
all robots that can, in parallel. What is found leads to the next revision.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from itertools import product

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.world import condition_holds
from fleet.planners.base import (
    BIG_DAG,
    LEAST_WORK,
    MONOLITHIC,
    PER_GOAL,
    NoPlan,
    Planner,
    PlanningProblem,
)
from fleet.planners.symbolic.action_sequences import (
    Exploration,
    GaveUp,
    Impossible,
    Subgoal,
    exploration_for,
    subgoals_in_order,
)
from fleet.planners.symbolic.candidates import Choice, allocated_as
from fleet.planners.symbolic.choosing import choose
from fleet.planners.symbolic.reached import Manner, Reached, no_way
from fleet.planners.symbolic.shared_work import done_again, loads_what_moves, needed_for_all
from fleet.scheduling.quick_allocation import quick_allocation
from keyexpr_schema.payloads.goals import Condition

MAX_RESTORATIONS = 2
"""How often what the sequences for later subgoals undid is reached again, where no plan does."""

AT_ONCE_SHARE = 0.05
"""Of the time that is left when there is a plan, how much may go into another one in which the
conditions of each goal are sought at once."""
SEARCH_SHARE = 0.6
"""Of the time for planning, how much the search for sequences has; choosing takes the rest."""


class SymbolicPlanner(Planner):
    """Search over skill models."""

    name = "symbolic"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC, LEAST_WORK)

    def _solve(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        world, rows = problem.world, problem.sometime_before
        for row in rows:
            if world.holds(row.then):
                return NoPlan(f"{row.first} must hold before {row.then} does, which it does now")
        if (broken := next(_broken_now(problem), None)) is not None:
            return NoPlan(broken)
        # What need not hold is avoided; where it cannot be, what has to hold before it does so
        # first. Where robots may not be somewhere, others must not be taken for them.
        wanted = tuple(row for row in rows if _is_wanted(row.then, problem))
        names = {name for goal in problem.goals for c in goal.constraints for name in c.subjects}
        bound = (False, True) if names & set(world.team) else (False,)
        first: NoPlan | None = None
        for manner in dict.fromkeys(Manner(o, b) for o, b in product((wanted, rows), bound)):
            made = self._made(problem, manner)
            if isinstance(made, CheckedPlan) or made.postponed:
                return made
            first = first or made
        assert first is not None
        return first

    def _made(self, problem: PlanningProblem, manner: Manner) -> CheckedPlan | NoPlan:
        """In one manner; for the least work each goal at once, if that is a plan for all of them,
        or for no fewer."""
        if problem.strategy != LEAST_WORK:
            made = self._one_by_one(problem, (), manner)
            return self._or_together(problem, manner, made)
        at_once = self._each_goal_at_once(problem, manner, NoPlan(problem.not_in_time))
        if isinstance(at_once, CheckedPlan) and len(at_once.plan.goals) == len(problem.goals):
            return at_once
        made = self._one_by_one(problem, (), manner)
        fewer = not isinstance(made, CheckedPlan) or (
            isinstance(at_once, CheckedPlan) and len(made.plan.goals) <= len(at_once.plan.goals)
        )
        return at_once if isinstance(at_once, CheckedPlan) and fewer else made

    def _or_together(
        self, problem: PlanningProblem, manner: Manner, made: CheckedPlan | NoPlan
    ) -> CheckedPlan | NoPlan:
        """The plan, or a shorter one: where one by one does the same work again (a machine for each
        dish), what it takes to do it once for all comes first; where something is taken away before
        all is on it, one search for all of a goal says how."""
        if (
            problem.strategy != BIG_DAG
            or not isinstance(made, CheckedPlan)
            or made.plan.seeks
            or made.plan.goals != tuple(goal.goal for goal in problem.goals)
        ):
            return made
        for other in self._together(problem, manner, made):
            if isinstance(other, CheckedPlan) and other.plan.goals == made.plan.goals:
                one, two = (allocated_as((), c, quick_allocation(c)) for c in (made, other))
                if one and two and two.cost < one.cost:
                    return other
        return made

    def _together(
        self, problem: PlanningProblem, manner: Manner, made: CheckedPlan
    ) -> Iterator[CheckedPlan | NoPlan]:
        again = done_again(made)
        if first := needed_for_all(problem, again):
            yield self._one_by_one(problem, first, manner)
        several = any(goal.conditions[1:] for goal in problem.goals)
        if several and (again or loads_what_moves(problem)):
            soon = replace(problem, budget=problem.budget.part(AT_ONCE_SHARE))
            yield self._each_goal_at_once(soon, manner, NoPlan(soon.not_in_time), patient=True)

    def _one_by_one(
        self,
        problem: PlanningProblem,
        first: tuple[Subgoal, ...],
        manner: Manner,
        set_down: bool = True,
    ) -> CheckedPlan | NoPlan:
        """A search for one condition after the other, beginning with some, when all that has to
        hold first has. `set_down` is that of `Reached`.
        """
        world = problem.world
        searching = problem.budget.until(SEARCH_SHARE)
        reached = Reached(problem, manner, dict(world.facts), searching, set_down)
        lost: dict[Subgoal, tuple[str, ...]] = {}
        late: set[str] = set()
        if (failed := reached.pass_first()) is not None:
            return failed
        subgoals = subgoals_in_order(problem, reached.facts)
        subgoals += [subgoal for subgoal in first if subgoal not in subgoals]
        subgoals.sort(key=lambda subgoal: subgoal not in first)
        for subgoal in subgoals:
            # One that is hard leaves half of the time to those after it.
            share = 1.0 if subgoal is subgoals[-1] else 0.5
            if not reached.time_is_up and reached.add(subgoal, share):
                continue
            if reached.time_is_up or isinstance(reached.failure, GaveUp):
                late.add(subgoal.goal)
            elif reached.failure.unlocated:
                lost[subgoal] = reached.failure.unlocated
            elif reached.options and subgoal not in first:
                # What was done for others before may be what makes it impossible.
                return self._one_by_one(problem, (subgoal, *first), manner, set_down)
            else:
                refused = NoPlan(no_way(subgoal, reached.failure, problem))
                alone = not any(g.goal == subgoal.goal and g.conditions[1:] for g in problem.goals)
                return refused if alone else self._each_goal_at_once(problem, manner, refused)
        if late and len(problem.goals) == 1 and isinstance(reached.failure, GaveUp):
            return NoPlan(reached.failure.reason, postponed=True)
        if late:
            return _in_time(problem, reached.options, late | {subgoal.goal for subgoal in lost})
        explored: Exploration | None = None
        if lost:
            seeks = tuple(dict.fromkeys(thing for things in lost.values() for thing in things))
            first_lost = next((s for s in lost if s.goal not in problem.by), next(iter(lost)))
            seeking = replace(problem, world=problem.world_of(first_lost.goal))
            explored = exploration_for(seeks, first_lost.goal, seeking, searching)
            if explored is None and searching.over:
                return NoPlan(problem.not_in_time, postponed=True)
            if explored is None:
                return NoPlan(_not_found(lost[first_lost], problem))
        made = choose(problem, reached.options, explored)
        for _ in range(MAX_RESTORATIONS):
            if problem.budget.over:
                break
            undone = [s for s in subgoals_in_order(problem, reached.facts) if s not in lost]
            if isinstance(made, CheckedPlan) or not (undone and reached.restore(undone)):
                break
            restored = choose(problem, reached.options, explored)
            made = restored if isinstance(restored, CheckedPlan) else made
        if isinstance(made, NoPlan):
            if problem.budget.over:
                return replace(made, postponed=True)  # not all choices were looked at
            if reached.any_set_down:
                return self._one_by_one(problem, first, manner, set_down=False)
            if problem.strategy != MONOLITHIC and len(problem.goals) > 1:
                # What one goal leaves in a hand may be what another begins with.
                in_a_row = choose(replace(problem, strategy=MONOLITHIC), reached.options, explored)
                if isinstance(in_a_row, CheckedPlan):
                    return in_a_row
            if not lost and any(goal.conditions[1:] for goal in problem.goals):
                return self._each_goal_at_once(problem, manner, made)
        return made

    def _each_goal_at_once(
        self, problem: PlanningProblem, manner: Manner, otherwise: NoPlan, patient: bool = False
    ) -> CheckedPlan | NoPlan:
        """All conditions of a goal in one search: what one of them leaves in a hand is there for
        the next, and what is undone on the way is made true again. `otherwise` where that is no
        plan either.
        """
        searching = problem.budget.until(SEARCH_SHARE)
        reached = Reached(problem, manner, dict(problem.world.facts), searching, patient=patient)
        if reached.pass_first() is not None:
            return otherwise
        wanted = {goal.goal: goal.conditions for goal in problem.goals}
        urgent_first = (s.goal for s in subgoals_in_order(problem, reached.facts))
        in_order = dict.fromkeys([*urgent_first, *wanted])  # what holds may be undone by then
        late: set[str] = set()
        for name in in_order:
            if all(condition_holds(reached.facts, c, problem.world) for c in wanted[name]):
                continue
            first, *others = wanted[name]
            # One that is hard leaves half of the time to those after it.
            share = 1.0 if name == next(reversed(in_order)) else 0.5
            whole = Subgoal(name, first, tuple(others))
            if not reached.time_is_up and reached.add(whole, share):
                continue
            if not reached.time_is_up and isinstance(reached.failure, Impossible):
                alone = not problem.goals[1:] and not any(c.any_of for c in wanted[name])
                if alone and otherwise.violations:
                    return NoPlan(no_way(whole, reached.failure, problem))
                return otherwise
            late.add(name)
        if late and len(problem.goals) == 1 and isinstance(reached.failure, GaveUp):
            return NoPlan(reached.failure.reason, postponed=True)
        if late:
            return _in_time(problem, reached.options, late)
        made = choose(problem, reached.options, None)
        return made if isinstance(made, CheckedPlan) else otherwise


def _in_time(
    problem: PlanningProblem,
    options: Sequence[Choice],
    late: Set[str],
) -> CheckedPlan | NoPlan:
    """A plan for those goals for which everything was found before the time was over."""
    goals = tuple(goal for goal in problem.goals if goal.goal not in late)
    found = [sequences for sequences in options if sequences[0].goal not in late]
    none = NoPlan(problem.not_in_time, postponed=True)
    if not found:
        return none
    made = choose(replace(problem, goals=goals), found, None)
    # What was found for a goal may need what was found for one that is late.
    return made if isinstance(made, CheckedPlan) else none


def _broken_now(problem: PlanningProblem) -> Iterator[str]:
    """What has to hold on the way and does not as it begins: no plan helps."""
    for condition in problem.always:
        if not problem.world.holds(condition):
            whose = problem.whose(condition)
            yield f"{condition} must always hold{whose}, and does not at the start"
    for condition in problem.never:
        if problem.world.holds(condition):
            whose = problem.whose(condition)
            yield f"{condition} must never hold{whose}, and does at the start"


def _is_wanted(condition: Condition, problem: PlanningProblem) -> bool:
    """Whether a goal cannot be reached without it."""
    return any(
        (wanted.relation, wanted.value) == (condition.relation, condition.value)
        and set(wanted.subjects) <= set(condition.subjects)
        for goal in problem.goals
        for wanted in goal.conditions
    )


def _not_found(lost: Sequence[str], problem: PlanningProblem) -> str:
    things = " or ".join(lost)
    if problem.searched:
        places = ", ".join(sorted(problem.searched))
        return f"nobody knows where {things} is; looked for in {places}, and not found"
    return (
        f"nobody knows where {things} is, and no connected robot "
        f"({', '.join(problem.world.team)}) can look for it"
    )
