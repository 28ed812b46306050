"""Runs planning jobs: planner, allocator and checker in a row, away from keys."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.allocators.base import Allocated, Allocator, NotAllocated
from fleet.core.actors import tasks_nobody_can_do
from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan, check_plan
from fleet.core.events import At, PlanningFailed, PlanningSucceeded
from fleet.core.model.world import WorldModel
from fleet.core.plan_entry import PlanningJob
from fleet.core.state import State
from fleet.core.state_updates import conditions_of
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.oversubscription import PartialPlan, plan_reachable_goals
from fleet.planners.plan_repair import repair_plan
from fleet.service.composition import Composition
from fleet.service.job_context import context_of, robots_under_way
from keyexpr_schema.facts import SEARCHED
from keyexpr_schema.payloads.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.tasks import TaskState


def run_planning_job(
    job: PlanningJob, state: State, composition: Composition, at: At
) -> PlanningSucceeded | PlanningFailed:
    """Plan, check and allocate; how it ended, as an event stamped with `at`."""
    started = time.perf_counter()
    allocator = composition.allocators.get(job.allocator)
    result: PlanningSucceeded | NoPlan
    if allocator is None:
        choices = ", ".join(sorted(composition.allocators))
        result = NoPlan(f"there is no allocator {job.allocator}: choose one of {choices}")
    else:
        run = _Run(job, state, composition, at, state.world(), allocator)
        result = run.repaired() or run.planned()
    took_s = time.perf_counter() - started
    if isinstance(result, PlanningSucceeded):
        return replace(result, planning_time_s=took_s)
    return PlanningFailed(
        **at,
        job=job.job,
        reason=result.reason,
        violations=result.violations,
        planning_time_s=took_s,
    )


@dataclass(frozen=True)
class _Run:
    job: PlanningJob
    state: State
    composition: Composition
    at: At
    world: WorldModel
    allocator: Allocator

    def repaired(self) -> PlanningSucceeded | None:
        """The residual plan, repaired if need be, with another allocation, if that will do."""
        planner = self.composition.planners.get(self.job.planner)
        if planner is None or self.job.residual is None:
            return None
        partial = repair_plan(
            self.job.residual,
            self._problem(),
            planner,
            self.composition.feasibility,
            self._reached(),
        )
        if partial is None:
            return None
        begun = {task.actor for task in partial.plan.tasks} & set(self.job.begun_actors)
        busy = robots_under_way(self.job, partial.plan, self.state, begun)
        allocated = self._allocate(partial.checked, busy)
        if isinstance(allocated, NotAllocated):
            return None
        if not self.job.reallocation and not partial.left_out and not partial.changed:
            return None  # it is as it was, and there is a reason why that will not do
        return self._succeeded(partial, allocated, repaired=True)

    def planned(self) -> PlanningSucceeded | NoPlan:
        """A new plan; of goals that can be reached, where the job allows that."""
        partial = self._plan()
        if isinstance(partial, NoPlan):
            return partial
        busy = robots_under_way(self.job, partial.plan, self.state)
        allocated = self._allocate(partial.checked, busy)
        if isinstance(allocated, NotAllocated):
            return NoPlan(allocated.violations[0].sentence, allocated.violations)
        return self._succeeded(partial, allocated)

    def _succeeded(
        self, partial: PartialPlan, allocated: Allocated, repaired: bool = False
    ) -> PlanningSucceeded:
        schedule = allocated.schedule
        durations_s = schedule.durations_s
        timed = (replace(task, duration_s=durations_s[task.task]) for task in partial.plan.tasks)
        notes = (f"goal {goal} is left out: {reason}" for goal, reason in partial.left_out.items())
        return PlanningSucceeded(
            **self.at,
            job=self.job.job,
            plan=replace(partial.plan, tasks=tuple(timed)),
            allocation=dict(allocated.allocation),
            sequence=dict(schedule.sequence),
            extra_after=dict(schedule.extra_after),
            durations_s=durations_s,
            predicted_makespan_s=schedule.makespan_s,
            lower_bound_s=allocated.lower_bound_s,
            notes=(*allocated.notes, *notes),
            repaired=repaired,
            left_out=dict(partial.left_out),
            planning_time_s=0.0,
        )

    def _allocate(self, checked: CheckedPlan, busy: Mapping[str, str]) -> Allocated | NotAllocated:
        """With actors that robots are `busy` with left where they are and begun with, if that can
        be; else only left where they are; else as if nothing were under way."""
        context = context_of(self.job, self.state, frozenset(busy))
        calm = changed(context, under_way=frozenset())
        plan = checked.plan
        pins = {**busy, **plan.pins}
        kept = checked if pins == plan.pins else check_plan(replace(plan, pins=pins), self.world)
        if isinstance(kept, InvalidPlan):
            return self.allocator.allocate(checked, calm)
        allocated = self.allocator.allocate(kept, context)
        if isinstance(allocated, NotAllocated) and context.under_way:
            allocated = self.allocator.allocate(kept, calm)
        if isinstance(allocated, NotAllocated) and kept is not checked:
            allocated = self.allocator.allocate(checked, calm)
        return allocated

    def _plan(self) -> PartialPlan | NoPlan:
        job, planners = self.job, self.composition.planners
        if job.proposal is not None:
            checked = check_plan(_with_goal_conditions(job.proposal, self.state), self.world)
            if isinstance(checked, InvalidPlan):
                violations = (*tasks_nobody_can_do(checked), *checked.violations)
                return NoPlan(violations[0].sentence, violations)
            return PartialPlan(checked)
        planner = planners.get(job.planner)
        if planner is None:
            return NoPlan(
                f"there is no planner {job.planner}: choose one of {', '.join(sorted(planners))}"
            )
        problem = self._problem()
        if not job.partial:
            plan = planner.plan(problem)
            return plan if isinstance(plan, NoPlan) else PartialPlan(plan)
        return plan_reachable_goals(planner, self.composition.feasibility, problem, self._reached())

    def _problem(self) -> PlanningProblem:
        job, state = self.job, self.state
        return PlanningProblem(
            plan=job.plan,
            goals=tuple(
                replace(state.goals[goal], conditions=_wanted(state.goal_states[goal], self.world))
                for goal in job.goals
                if goal in state.goals
            ),
            world=self.world,
            revision=job.revision,
            strategy=job.strategy,
            allocator=job.allocator,
            first_task=job.first_task,
            searched=_searched(job, state, self.composition),
        )

    def _reached(self) -> frozenset[str]:
        return frozenset(
            goal
            for goal in self.job.goals
            if goal in self.state.goal_states
            and self.state.goal_states[goal].state is GoalState.REACHED
        )


def _wanted(status: GoalStatus, world: WorldModel) -> tuple[Condition, ...]:
    """What a goal still wants: all that it says, or, once reached, that what holds is kept."""
    if status.state is GoalState.REACHED:
        return tuple(condition for condition in status.conditions if world.holds(condition))
    return status.conditions


def _searched(job: PlanningJob, state: State, composition: Composition) -> frozenset[str]:
    """Places that a finished task of this plan has searched."""
    entry = state.plans.get(job.plan)
    return frozenset(
        literal.variable.subject
        for record in (entry.records.values() if entry else ())
        if record.state is TaskState.SUCCEEDED and record.skill in composition.skills
        for literal in composition.skills[record.skill].ground(record.args).after
        if literal.variable.relation == SEARCHED
    )


def _with_goal_conditions(plan: Plan, state: State) -> Plan:
    """A proposed plan answers for its goals: their conditions must hold at its end, too."""
    wanted = conditions_of(state, plan.goals)
    return replace(plan, conditions=tuple(dict.fromkeys([*plan.conditions, *wanted])))
