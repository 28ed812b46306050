"""Carries out planning jobs: planner, allocator and checker in a row, away from keys."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, field
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.allocators.base import Allocated, Allocator, NotAllocated
from fleet.core.checker.checked_plan import CheckedPlan, InvalidPlan, check_plan
from fleet.core.events import PlanningFailed, PlanningSucceeded
from fleet.core.model.world import WorldModel
from fleet.core.schedule.actor_constraints import tasks_nobody_can_do
from fleet.core.state import PlanningJob, State
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.service.allocation_context import circumstances_of
from fleet.service.composition import Composition
from fleet.service.oversubscription import PartialPlan, plan_what_can_be
from fleet.service.plan_repair import mended_plan
from keyexpr_schema.facts import SEARCHED
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.tasks import TaskState


@dataclass(frozen=True)
class _Made:
    plan: Plan
    allocated: Allocated
    mended: bool = False
    left_out: Mapping[str, str] = field(default_factory=dict)


def carry_out(
    job: PlanningJob, state: State, parts: Composition, at: Mapping[str, float]
) -> PlanningSucceeded | PlanningFailed:
    """Plan, check and allocate; how it ended, as an event stamped with `at`.

    `at` has the event's `time_s` and `wall_time_s`.
    """
    started = time.perf_counter()
    made = _plan_and_allocate(job, state, parts)
    took_s = time.perf_counter() - started
    if isinstance(made, NoPlan):
        return PlanningFailed(
            **at,
            job=job.job,
            reason=made.reason,
            violations=made.violations,
            planning_time_s=took_s,
        )
    allocated, schedule = made.allocated, made.allocated.schedule
    durations_s = {task: end_s - schedule.start_s[task] for task, end_s in schedule.end_s.items()}
    timed = [replace(task, duration_s=durations_s[task.task]) for task in made.plan.tasks]
    return PlanningSucceeded(
        **at,
        job=job.job,
        plan=replace(made.plan, tasks=tuple(timed)),
        allocation=dict(allocated.allocation),
        sequence=dict(schedule.sequence),
        extra_after=dict(schedule.extra_after),
        durations_s=durations_s,
        makespan_s=schedule.makespan_s,
        lower_bound_s=allocated.lower_bound_s,
        notes=allocated.notes,
        mended=made.mended,
        left_out=dict(made.left_out),
        planning_time_s=took_s,
    )


def _plan_and_allocate(job: PlanningJob, state: State, parts: Composition) -> _Made | NoPlan:
    allocator = parts.allocators.get(job.allocator)
    if allocator is None:
        choices = ", ".join(sorted(parts.allocators))
        return NoPlan(f"there is no allocator {job.allocator}: choose one of {choices}")
    desk = _Desk(job, state, parts, state.world(parts.skills), allocator)
    return (desk.mended() if job.remaining is not None else None) or desk.planned()


@dataclass(frozen=True)
class _Desk:
    job: PlanningJob
    state: State
    parts: Composition
    world: WorldModel
    allocator: Allocator

    def mended(self) -> _Made | None:
        """What is left of the plan with another allocation, if that will do."""
        planner = self.parts.planners.get(self.job.planner)
        if planner is None or self.job.remaining is None:
            return None
        made = mended_plan(
            self.job.remaining, self._problem(), planner, self.parts.judge, self._reached()
        )
        if made is None:
            return None
        begun = {task.actor for task in made.plan.tasks} & set(self.job.begun)
        found = self._allocate(made.checked, _busy_robots(self.job, made.plan, self.state, begun))
        if isinstance(found, NotAllocated):
            return None
        if not self.job.outside and not made.left_out and not made.changed:
            return None  # it is as it was, and there is a reason why that will not do
        return self._made(made, found, mended=True)

    def planned(self) -> _Made | NoPlan:
        """A new plan; of goals that can be reached, where the job allows that."""
        made = self._plan()
        if isinstance(made, NoPlan):
            return made
        found = self._allocate(made.checked, _busy_robots(self.job, made.plan, self.state))
        if isinstance(found, NotAllocated):
            return NoPlan(found.violations[0].sentence, found.violations)
        return self._made(made, found)

    def _made(self, made: PartialPlan, found: Allocated, mended: bool = False) -> _Made:
        told = (f"goal {goal} is left out: {reason}" for goal, reason in made.left_out.items())
        found = changed(found, notes=(*found.notes, *told))
        return _Made(made.plan, found, mended, made.left_out)

    def _allocate(self, checked: CheckedPlan, busy: Mapping[str, str]) -> Allocated | NotAllocated:
        """With actors that robots are `busy` with left where they are and begun with, if that can
        be; else only left where they are; else as if nothing were under way."""
        told = circumstances_of(self.job, self.state, frozenset(busy))
        calm = changed(told, under_way=frozenset())
        plan = checked.plan
        pins = {**busy, **plan.pins}
        kept = checked if pins == plan.pins else check_plan(replace(plan, pins=pins), self.world)
        if isinstance(kept, InvalidPlan):
            return self.allocator.allocate(checked, calm)
        made = self.allocator.allocate(kept, told)
        if isinstance(made, NotAllocated) and told.under_way:
            made = self.allocator.allocate(kept, calm)
        if isinstance(made, NotAllocated) and kept is not checked:
            made = self.allocator.allocate(checked, calm)
        return made

    def _plan(self) -> PartialPlan | NoPlan:
        job, planners = self.job, self.parts.planners
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
            made = planner.plan(problem)
            return made if isinstance(made, NoPlan) else PartialPlan(made)
        return plan_what_can_be(planner, self.parts.judge, problem, self._reached())

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
            searched=_searched(job, state, self.parts),
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


def _busy_robots(
    job: PlanningJob, plan: Plan, state: State, begun_actors: Set[str] = frozenset()
) -> dict[str, str]:
    """Actors of the new plan whose work a robot has begun already, so that it goes on with it.

    Of `begun_actors` that is known; they and what their robots do are left out.
    """
    entry = state.plans.get(job.plan)
    begun: dict[tuple[object, ...], list[str]] = {}
    for name in job.running:
        record = entry.records.get(name) if entry is not None else None
        if record is not None and record.robot and record.actor not in begun_actors:
            work = _work(record.skill, record.args, (record.robot, *state.robots))
            begun.setdefault(work, []).append(record.robot)
    pins: dict[str, str] = {}
    for task in plan.tasks:
        if task.actor in begun_actors:
            continue
        robots = begun.get(_work(task.skill, task.args, ()))
        if robots and task.actor not in pins and robots[0] not in pins.values():
            pins[task.actor] = robots.pop(0)
    return pins


def _work(skill: str, args: Mapping[str, str], robots: Iterable[str | None]) -> tuple[object, ...]:
    """What a task is about, whoever does it."""
    others = set(robots)
    return skill, *sorted(
        (name, value)
        for name, value in args.items()
        if value not in others and actor_in(value) is None
    )


def _searched(job: PlanningJob, state: State, parts: Composition) -> frozenset[str]:
    """Places that a finished task of this plan has searched."""
    entry = state.plans.get(job.plan)
    return frozenset(
        literal.variable.subject
        for record in (entry.records.values() if entry else ())
        if record.state is TaskState.SUCCEEDED and record.skill in parts.skills
        for literal in parts.skills[record.skill].ground(record.args).after
        if literal.variable.relation == SEARCHED
    )


def _with_goal_conditions(plan: Plan, state: State) -> Plan:
    """A proposed plan answers for its goals: their conditions must hold at its end, too."""
    wanted = [
        condition
        for goal in plan.goals
        if goal in state.goal_states
        for condition in state.goal_states[goal].conditions
    ]
    return replace(plan, conditions=tuple(dict.fromkeys([*plan.conditions, *wanted])))
