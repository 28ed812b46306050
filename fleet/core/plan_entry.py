"""What the planner keeps of one plan, and the planning jobs that make its revisions."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
from msgspec.structs import replace

from fleet.core.indexes.plan_index import EMPTY_INDEX, PlanGraph, PlanIndex
from fleet.core.model.skills import Skills
from fleet.core.model.world import Hopeless
from fleet.core.replan_reasons import ReplanReason, ReplanScope, TaskAdded, Wish
from fleet.core.table import Table
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanChange, PlanState, Task, Violation
from keyexpr_schema.payloads.tasks import TaskRecord

SAYS_WHY_SINCE_LOGIC = 11
"""Before this logic of the core, a plan that was cancelled did not say why."""


class PlanOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What allocation came to: robots of actors, each robot's actors in order, predicted times."""

    allocation: dict[str, str] = {}
    sequence: dict[str, tuple[str, ...]] = {}
    predicted_makespan_s: float | None = None
    lower_bound_s: float | None = None
    mission_bound_s: float | None = None
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
    programs: bool = False
    """Whether the plan is to be carried out as programs."""
    first_task: int = 1
    proposal: Plan | None = None
    team_number: int = 0
    """`State.team_number` when the job was given."""
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
    """The strongest of the reasons and wishes that the job takes up."""
    takes_up: tuple[int, ...] = ()
    """Their numbers. At its end exactly those are met or refused."""

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
            programs=plan.programs,
        )

    @property
    def reallocation(self) -> bool:
        """Whether it suffices to allocate the residual plan again."""
        return self.reason is not None and self.reason.scope is ReplanScope.REALLOCATE


class PlanEntry(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A plan with everything the planner keeps about it.

    `records` hold the tasks of every revision; `plan` is the one in work. With `reasons`, and with
    `wishes` of people, which are not part of it yet, it is made again; what they do not touch is
    ordered meanwhile (`fleet.core.dispatch.while_replanning`). `given_out` are tasks that were
    ordered since the present job began, `discarded` counts jobs in a row whose plan did without
    such tasks. `unwanted` are tasks under way that a new revision does without; their orders are
    cancelled. So are those of `halting`: a pause interrupts them, and they are to be done again
    later. `by_hand` are tasks that somebody has done, with a sentence; of these, those under way
    are among the `unwanted`. `team` are the robots that were there when the plan was made. `late`
    are tasks that took far longer than predicted, and were reacted to. `failures` counts the tasks
    of each goal that failed for good, `fruitless_replans` the revisions since a goal was last
    reached.
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
    reasons: tuple[ReplanReason, ...] = ()
    wishes: tuple[Wish, ...] = ()
    replan_reasons: int = 0
    """How many reasons and wishes there have been."""
    added: Table[str, TaskAdded] = Table()
    """Tasks that people have added, by actor: planning anew for the goals does not lose them."""
    given_out: Table[str, None] = Table()
    discarded: int = 0
    late: tuple[str, ...] = ()
    failures: Table[str, int] = Table()
    hopeless: tuple[Hopeless, ...] = ()
    """Calls that failed in a way that their workers say is not worth another try."""
    waits_for_team: int | None = None
    """What `State.team_number` was when no robot could go on with the plan; it is not made again
    before another comes, or something else happens."""
    unwanted: tuple[str, ...] = ()
    halting: tuple[str, ...] = ()
    by_hand: Table[str, str] = Table()
    team: tuple[str, ...] = ()
    change: PlanChange | None = None
    fruitless_replans: int = 0
    cancelling: bool = False
    approved_by: str = ""
    reason: str | None = None
    violations: tuple[Violation, ...] = ()
    changed_s: float = 0.0
    changed_wall_s: float | None = None
    begun_s: float | None = None
    begun_wall_s: float | None = None
    """When it was asked for, on the fleet's clock [s] and in Unix time [s]."""
    index: PlanIndex = EMPTY_INDEX

    @property
    def ended(self) -> bool:
        """Whether nothing will happen to this plan any more."""
        return self.state in ENDED_PLANS

    @property
    def next_task_number(self) -> int:
        """The first number that no task of the plan has had."""
        return 1 + max((int(name[1:]) for name in self.records if name[1:].isdigit()), default=0)

    @property
    def open_reasons(self) -> tuple[ReplanReason, ...]:
        """Why the plan is to be made again: reasons, and wishes as reasons."""
        return (*self.reasons, *(wish.reason for wish in self.wishes))

    @property
    def replan(self) -> ReplanReason | None:
        """The strongest reason to make the plan again; of equally strong ones, the newest."""
        ranked = [(reason.scope.strength, reason.number, reason) for reason in self.open_reasons]
        return max(ranked)[2] if ranked else None

    @property
    def wanted_goals(self) -> tuple[str, ...]:
        """The goals of the plan in work, and those that are to go into it."""
        if not self.wishes:
            return self.plan.goals
        more = (goal for wish in self.wishes for goal in wish.goals)
        return tuple(dict.fromkeys([*self.plan.goals, *more]))

    def is_wanted(self, task: Task | TaskRecord) -> bool:
        """Whether a task is for a goal that the plan still has, or for none."""
        return task.goal is None or task.goal in self.plan.goals

    def current(self) -> Iterator[TaskRecord]:
        """The records of the current revision's tasks."""
        return (self.records[task.task] for task in self.plan.tasks if task.task in self.records)

    def outstanding(self) -> list[TaskRecord]:
        """Tasks that a robot has an order for."""
        return [self.records[task] for task in self.index.outstanding]

    def indexed(self, known: PlanEntry | None, skills: Skills) -> PlanEntry:
        """The entry with its index, as far as it differs from the entry `known` before."""
        graph = known.index.graph if known is not None else None
        if known is None or known.plan.tasks is not self.plan.tasks or graph is None:
            graph = PlanGraph((task.task for task in self.plan.tasks), self.records, skills)
        elif known.records is self.records:
            return self
        names = (task.task for task in self.plan.tasks)
        return replace(self, index=PlanIndex.of(names, self.records, graph))

    def to_replan(
        self,
        scope: ReplanScope,
        sentence: str,
        *,
        goals: tuple[str | None, ...] = (),
        tasks: tuple[str, ...] = (),
        robots: tuple[str, ...] = (),
        variables: tuple[FactKey, ...] = (),
        whole: bool = False,
    ) -> PlanEntry:
        """The entry with one more reason to make the plan again, and what that touches.

        It takes the place of one about the same that no job has taken up yet.
        """
        new = ReplanReason(
            scope=scope,
            number=self.replan_reasons + 1,
            sentence=sentence,
            goals=tuple(goal for goal in goals if goal is not None),
            tasks=tasks,
            robots=robots,
            variables=variables,
            whole=whole,
        )
        taken = self.job.takes_up if self.job is not None else ()
        others = tuple(
            reason
            for reason in self.reasons
            if reason.number in taken
            or replace(new, number=reason.number, sentence=reason.sentence) != reason
        )
        return replace(self, reasons=(*others, new), replan_reasons=new.number, waits_for_team=None)

    def wishing(self, wish: Wish) -> PlanEntry:
        """The entry with one more wish, which is numbered here."""
        number = self.replan_reasons + 1
        wish = replace(wish, number=number)
        return replace(
            self, wishes=(*self.wishes, wish), replan_reasons=number, waits_for_team=None
        )

    def job_ended(self) -> tuple[PlanEntry, tuple[ReplanReason, ...], tuple[Wish, ...]]:
        """The entry without its job and what that took up; the reasons and the wishes taken up."""
        taken = self.job.takes_up if self.job is not None else ()
        entry = replace(
            self,
            job=None,
            reasons=tuple(reason for reason in self.reasons if reason.number not in taken),
            wishes=tuple(wish for wish in self.wishes if wish.number not in taken),
        )
        return (
            entry,
            tuple(reason for reason in self.reasons if reason.number in taken),
            tuple(wish for wish in self.wishes if wish.number in taken),
        )
