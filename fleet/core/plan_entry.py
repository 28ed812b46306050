"""What the planner keeps of one plan, and the planning jobs that make its revisions."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum

import msgspec
from msgspec.structs import replace

from fleet.core.table import Table
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanChange, PlanState, Task, Violation
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

OUTSTANDING = frozenset({TaskState.ORDERED, TaskState.RUNNING})
"""Tasks that a robot has an order for."""


class ReplanScope(Enum):
    """How much of a plan is made again."""

    REALLOCATE = "reallocate"
    """Nothing speaks against the plan: robots came, went or are late, or a goal was deleted."""
    REPAIR = "repair"
    """Goals that the residual plan no longer serves are planned anew, beside the rest."""
    ANEW = "anew"
    """Everything is planned from the facts."""


class ReplanReason(msgspec.Struct, frozen=True, kw_only=True):
    """Why a plan is made again. `number` tells reasons of one plan apart that read the same."""

    scope: ReplanScope
    number: int
    sentence: str


class PlanOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What allocation came to: robots of actors, each robot's actors in order, predicted times."""

    allocation: dict[str, str] = {}
    sequence: dict[str, tuple[str, ...]] = {}
    predicted_makespan_s: float | None = None
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()
    planning_time_s: float | None = None


class PlanningJob(msgspec.Struct, frozen=True, kw_only=True):
    """Planning to be done outside the core: for goals, or of a plan that someone proposed."""

    job: int
    plan: str
    revision: int
    goals: tuple[str, ...]
    strategy: str
    planner: str
    allocator: str
    first_task: int = 1
    proposal: Plan | None = None
    request: str | None = None
    dry_run: bool = False
    partial: bool = False
    """Whether goals that cannot be reached are left out, and not the whole plan refused."""
    residual: Plan | None = None
    """What is left of the plan, where that may be reallocated or repaired."""
    previous_allocation: dict[str, str] = {}
    actor_order: tuple[str, ...] = ()
    """The actors of the plan until now, in the order in which they were to begin."""
    begun_actors: tuple[str, ...] = ()
    under_way: tuple[str, ...] = ()
    """Tasks of the plan that were under way when the job was given."""
    reason: ReplanReason | None = None

    @classmethod
    def of(cls, number: int, plan: Plan, planner: str) -> PlanningJob:
        """Job `number`: to make `plan`, whatever tasks it has now."""
        return cls(
            job=number,
            plan=plan.plan,
            revision=plan.revision,
            goals=plan.goals,
            strategy=plan.strategy,
            planner=planner,
            allocator=plan.allocator,
        )

    @property
    def reallocation(self) -> bool:
        """Whether it suffices to allocate the residual plan again."""
        return self.reason is not None and self.reason.scope is ReplanScope.REALLOCATE


class PlanEntry(msgspec.Struct, frozen=True, kw_only=True):
    """A plan with everything the planner keeps about it.

    `records` hold the tasks of every revision; `plan` only those of the current one. With a
    `replan` reason set, nothing more is ordered, and the plan is made again. `unwanted` are tasks
    under way that a new revision does without; their orders are cancelled. `team` are the robots
    that were there when the plan was made. `late` are tasks that took far longer than predicted,
    and were reacted to. `failures` counts the tasks of each goal that failed for good,
    `fruitless_replans` the revisions since a goal was last reached.
    """

    plan: Plan
    state: PlanState
    planner: str = "symbolic"
    lineage: str | None = None
    """That of the planner that gives the plan's orders; `None` in what is older than lineages."""
    start: bool = True
    records: Table[str, TaskRecord] = Table()
    outcome: PlanOutcome = PlanOutcome()
    job: PlanningJob | None = None
    replan: ReplanReason | None = None
    replan_reasons: int = 0
    """How many reasons to plan again there have been."""
    late: tuple[str, ...] = ()
    failures: Table[str, int] = Table()
    amendment: Task | None = None
    """A task that someone wants added, and the request for it."""
    amendment_request: str | None = None
    unwanted: tuple[str, ...] = ()
    team: tuple[str, ...] = ()
    change: PlanChange | None = None
    fruitless_replans: int = 0
    cancelling: bool = False
    reason: str | None = None
    violations: tuple[Violation, ...] = ()
    changed_s: float = 0.0
    begun_s: float | None = None
    begun_wall_s: float | None = None
    """When it was asked for, on the fleet's clock [s] and in Unix time [s]."""

    @property
    def ended(self) -> bool:
        """Whether nothing will happen to this plan any more."""
        return self.state in ENDED_PLANS

    @property
    def next_task_number(self) -> int:
        """The first number that no task of the plan has had."""
        return 1 + max((int(name[1:]) for name in self.records if name[1:].isdigit()), default=0)

    def current(self) -> Iterator[TaskRecord]:
        """The records of the current revision's tasks."""
        return (self.records[task.task] for task in self.plan.tasks if task.task in self.records)

    def outstanding(self) -> list[TaskRecord]:
        """Tasks that a robot has an order for."""
        return [record for record in self.records.values() if record.state in OUTSTANDING]

    def to_replan(self, scope: ReplanScope, sentence: str) -> PlanEntry:
        """The entry with a new reason to make the plan again, in place of one before."""
        number = self.replan_reasons + 1
        reason = ReplanReason(scope=scope, number=number, sentence=sentence)
        return replace(self, replan=reason, replan_reasons=number)
