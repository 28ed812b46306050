"""Runs planning jobs: planner, allocator and checker in a row, from nothing but their input."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from dataclasses import replace as changed
from typing import TypeVar

from msgspec.structs import replace

from fleet.allocators.base import Allocated, Allocator, NotAllocated
from fleet.allocators.charging import ChargedPlan, allocate_with_charging
from fleet.core.actors import tasks_nobody_can_do
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.events import GoalInterpreted, PlanningFailed, PlanningSucceeded
from fleet.core.model.world import WorldModel
from fleet.core.planning_input import InterpretationInput, PlanningInput
from fleet.jobshop.time_budget import Clock, TimeBudget
from fleet.language.methods.entry import entry_of
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.contradictions import contradictions, reasons_of
from fleet.planners.mission_bound import mission_bound_s
from fleet.planners.oversubscription import PartialPlan, plan_reachable_goals
from fleet.planners.plan_repair import repair_plan
from fleet.planners.programs.base import ProgramWriter
from fleet.planners.programs.joining import joined
from fleet.planners.programs.writer import Writers, with_programs
from fleet.service.composition import Composition
from fleet.service.planning.job_context import context_of, robots_under_way
from keyexpr_schema.payloads.plans import Plan

T = TypeVar("T")
PLANNERS_SHARE = 0.5
"""Of a job's time, how much its planner has; allocating and checking take the rest."""
ALLOCATED_BY = 0.9
"""When, of a job's time, allocators should have come to an answer."""
BOUNDING_SHARE = 0.02
"""Of what is left then, how much at most is spent on what the goals take at least."""


def run_planning_job(
    given: PlanningInput, composition: Composition, clock: Clock = time.perf_counter
) -> PlanningSucceeded | PlanningFailed:
    """Plan, check and allocate; how it ended, as an event at the time of the input.

    `clock` is what the planner's share of the time limit goes by.
    """
    started = time.perf_counter()
    limit = TimeBudget(given.limit_s, clock)
    budget = TimeBudget(PLANNERS_SHARE * given.limit_s, clock)
    result = _result(given, composition, budget, limit.until(ALLOCATED_BY))
    for_robots = _goals_for_robots(given, composition.feasibility, result, budget)
    took_s = time.perf_counter() - started
    if isinstance(result, PlanningSucceeded):
        left_out = result.left_out
        return replace(
            result,
            planning_time_s=took_s,
            left_out={g: reason for g, reason in left_out.items() if g not in for_robots},
            for_robots={g: reason for g, reason in left_out.items() if g in for_robots},
        )
    return PlanningFailed(
        time_s=given.time_s,
        wall_time_s=given.wall_time_s,
        job=given.job.job,
        reason=result.reason,
        violations=result.violations,
        planning_time_s=took_s,
        postponed=result.postponed,
        for_robots=for_robots,
        goal_reasons=dict(result.goal_reasons),
    )


def run_interpretation(given: InterpretationInput, composition: Composition) -> GoalInterpreted:
    """Have a language model say a goal's sentence in other words, at the time of the input."""
    said = composition.paraphraser.paraphrase(
        given.text, given.refusal, given.vocabulary(), given.now, world=given.world()
    )
    task = None if isinstance(said, str) else said.task
    return GoalInterpreted(
        time_s=given.time_s,
        wall_time_s=given.wall_time_s,
        goal=given.goal,
        text=given.text,
        paraphrase=None if isinstance(said, str) else said.text,
        teaches=None if task is None else entry_of(task),
        reason=said if isinstance(said, str) else None,
    )


def _result(
    given: PlanningInput, composition: Composition, budget: TimeBudget, limit: TimeBudget
) -> PlanningSucceeded | NoPlan:
    job = given.job
    allocator = composition.allocators.get(job.allocator)
    planner = composition.planners.get(job.planner)
    if allocator is None:
        choices = ", ".join(sorted(composition.allocators))
        return NoPlan(f"there is no allocator {job.allocator}: choose one of {choices}")
    if planner is None:
        choices = ", ".join(sorted(composition.planners))
        return NoPlan(f"there is no planner {job.planner}: choose one of {choices}")
    world = given.world()
    writers = _writers(composition, world, with_model=planner.name == composition.model_writer.name)
    feasibility = composition.feasibility
    run = _Run(given, world, planner, feasibility, allocator, budget, limit, writers)
    return run.repaired() or run.planned()


def _writers(composition: Composition, world: WorldModel, with_model: bool) -> Writers:
    """Who writes programs: a robot's own writer first, then, in a plan of the language model's, the
    language model."""
    found: dict[str, tuple[ProgramWriter, ...]] = {}
    for spec in world.robots.values():
        own = composition.program_writers.get(spec.model)
        found[spec.model] = (
            *((own,) if own is not None else ()),
            *((composition.model_writer,) if with_model else ()),
        )
    return found


def _goals_for_robots(
    given: PlanningInput,
    feasibility: Planner,
    result: PlanningSucceeded | NoPlan,
    budget: TimeBudget,
) -> tuple[str, ...]:
    """Of goals without a plan, those that could be reached if all robots were connected and nothing
    was closed, or, where no robot is, might be."""
    if not given.job.partial:
        return ()
    if isinstance(result, PlanningSucceeded):
        missing = set(result.left_out)
    else:
        missing = set() if result.postponed else {goal.goal for goal in given.goals}
    open_goals = [g for g in given.goals if g.goal in missing and g.goal not in given.reached]
    if not given.available:
        return tuple(goal.goal for goal in open_goals)
    all_there = len(given.available) == len(given.robots)
    if not open_goals or (all_there and not given.closures):
        return ()
    world = given.world()
    everybody = changed(world, available=frozenset(world.robots), closures=())
    problem = changed(_problem(given, everybody, budget), strategy=feasibility.strategies[0])
    return tuple(
        goal.goal
        for goal in open_goals
        if isinstance(feasibility.plan(changed(problem, goals=(goal,))), CheckedPlan)
    )


def _problem(given: PlanningInput, world: WorldModel, budget: TimeBudget) -> PlanningProblem:
    job = given.job
    return PlanningProblem(
        plan=job.plan,
        goals=given.goals,
        world=world,
        revision=job.revision,
        strategy=job.strategy,
        allocator=job.allocator,
        first_task=job.first_task,
        searched=frozenset(given.searched),
        budget=budget,
        keepers=given.keepers,
    )


@dataclass(frozen=True)
class _Run:
    given: PlanningInput
    world: WorldModel
    planner: Planner
    feasibility: Planner
    allocator: Allocator
    budget: TimeBudget
    limit: TimeBudget
    writers: Writers

    def repaired(self) -> PlanningSucceeded | None:
        """The residual plan, repaired if need be, with another allocation, if that will do."""
        job = self.given.job
        if job.residual is None:
            return None
        partial = repair_plan(
            job.residual, self._problem(), self.planner, self.feasibility, self._reached()
        )
        if partial is None:
            return None
        partial = self._as_programs(partial)
        begun = {task.actor for task in partial.plan.tasks} & set(job.begun_actors)
        busy = robots_under_way(self.given, partial.plan, begun)
        allocated = self._allocate(partial.checked, busy)
        if isinstance(allocated, NotAllocated):
            return None
        partial = changed(partial, checked=allocated.checked)
        if not job.reallocation and not partial.incomplete and not partial.changed:
            return None  # it is as it was, and there is a reason why that will not do
        return self._succeeded(partial, allocated.allocated, repaired=True)

    def planned(self) -> PlanningSucceeded | NoPlan:
        """A new plan; of goals that can be reached, where the job allows that."""
        partial = self._plan()
        if isinstance(partial, NoPlan):
            return partial
        partial = self._as_programs(partial)
        allocated = self._allocate(partial.checked, robots_under_way(self.given, partial.plan))
        if isinstance(allocated, NotAllocated):
            return NoPlan(allocated.violations[0].sentence, allocated.violations)
        partial = changed(partial, checked=allocated.checked)
        return self._succeeded(partial, allocated.allocated)

    def _succeeded(
        self, partial: PartialPlan, allocated: Allocated, repaired: bool = False
    ) -> PlanningSucceeded:
        schedule = allocated.schedule
        durations_s = schedule.durations_s
        timed = (replace(task, duration_s=durations_s[task.task]) for task in partial.plan.tasks)
        left_out, postponed = dict(partial.left_out), dict(partial.postponed)
        missing = {**left_out, **postponed}
        notes = (f"goal {goal} is left out: {reason}" for goal, reason in missing.items())
        return PlanningSucceeded(
            time_s=self.given.time_s,
            wall_time_s=self.given.wall_time_s,
            job=self.given.job.job,
            plan=replace(partial.plan, tasks=tuple(timed), programs=self.given.job.programs),
            allocation=dict(allocated.allocation),
            sequence=dict(schedule.sequence),
            extra_after=dict(schedule.extra_after),
            durations_s=durations_s,
            predicted_makespan_s=schedule.makespan_s,
            lower_bound_s=allocated.lower_bound_s,
            mission_bound_s=self._mission_bound_s(partial.plan),
            notes=(*allocated.notes, *notes),
            repaired=repaired,
            left_out=left_out,
            postponed=postponed,
            not_in_time=partial.not_in_time,
            planning_time_s=0.0,
        )

    def _mission_bound_s(self, plan: Plan) -> float | None:
        """What the goals of the plan take at least; nothing is known of how far work under way is,
        nor of what is still to be found."""
        if self.given.under_way or plan.seeks:
            return None
        goals = (goal for goal in self.given.goals if goal.goal in plan.goals)
        return mission_bound_s(goals, self.world, self.limit.part(BOUNDING_SHARE))

    def _allocate(
        self, checked: CheckedPlan, busy: Mapping[str, str]
    ) -> ChargedPlan | NotAllocated:
        """With actors that robots are `busy` with left where they are and begun with, if that can
        be; else only left where they are; else as if nothing were under way."""
        context = context_of(self.given, frozenset(busy), self.limit)
        calm = changed(context, under_way=frozenset())
        plan = checked.plan
        pins = {**busy, **plan.pins}
        kept = checked if pins == plan.pins else check_plan(replace(plan, pins=pins), self.world)
        if isinstance(kept, InvalidPlan):
            return allocate_with_charging(self.allocator, checked, calm)
        allocated = allocate_with_charging(self.allocator, kept, context)
        if isinstance(allocated, NotAllocated) and context.under_way:
            allocated = allocate_with_charging(self.allocator, kept, calm)
        if isinstance(allocated, NotAllocated) and kept is not checked:
            allocated = allocate_with_charging(self.allocator, checked, calm)
        return allocated

    def _plan(self) -> PartialPlan | NoPlan:
        job = self.given.job
        if job.proposal is not None:
            proposed = self._with_goal_conditions(job.proposal)
            written = with_programs(
                proposed, self.world, self.feasibility, self.budget, self.writers
            )
            if isinstance(written, NoPlan):
                return written
            checked = check_plan(written, self.world)
            if isinstance(checked, InvalidPlan):
                violations = (*tasks_nobody_can_do(checked), *checked.violations)
                return NoPlan(violations[0].sentence, violations)
            return PartialPlan(checked)
        problem = self._problem()
        if job.partial:
            return plan_reachable_goals(self.planner, self.feasibility, problem, self._reached())
        plan = self.planner.plan(problem)
        if isinstance(plan, CheckedPlan):
            return PartialPlan.of(plan, problem)
        if plan.postponed:
            return plan
        reasons = reasons_of(contradictions(self.feasibility, problem), problem)
        if not reasons:
            return plan
        first = next(goal.goal for goal in problem.goals if goal.goal in reasons)
        sentence = f"goal {first} cannot be planned: {reasons[first]}"
        return changed(plan, reason=sentence, goal_reasons=reasons)

    def _as_programs(self, partial: PartialPlan) -> PartialPlan:
        """With programs for what actors do in a row, if that is asked for."""
        if not self.given.job.programs:
            return partial
        return changed(partial, checked=joined(partial.checked))

    def _problem(self) -> PlanningProblem:
        return _problem(self.given, self.world, self.budget)

    def _reached(self) -> frozenset[str]:
        return frozenset(self.given.reached)

    def _with_goal_conditions(self, plan: Plan) -> Plan:
        """A proposed plan answers for its goals: their conditions must hold at its end, too."""
        goals = self.given.goals
        return replace(
            plan,
            conditions=_both(plan.conditions, (c for g in goals for c in g.conditions)),
            always=_both(plan.always, (c for g in goals for c in g.always)),
            never=_both(plan.never, (c for g in goals for c in g.never)),
            sometime_before=_both(
                plan.sometime_before, (row for g in goals for row in g.sometime_before)
            ),
            by={**plan.by, **{g.goal: g.by for g in goals if g.by}},
        )


def _both(mine: Iterable[T], wanted: Iterable[T]) -> tuple[T, ...]:
    return tuple(dict.fromkeys([*mine, *wanted]))
