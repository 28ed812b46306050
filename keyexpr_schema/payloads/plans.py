"""Payloads about plans: a DAG of tasks, each done by an actor."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.goals import Condition, Precedence
from keyexpr_schema.payloads.programs import Program
from keyexpr_schema.payloads.waits import WaitReason


class PlanAddress(Address, frozen=True):
    """One plan."""

    plan: str


class Task(Payload, frozen=True, kw_only=True):
    """One skill call, or, with the skill `do` and a `program`, a sentence for a robot.

    `args` maps parameter names of the skill to ids; `?a1` names the actor `a1`.
    `after` lists tasks that must have succeeded before this one starts.
    """

    task: Id
    skill: Id
    args: dict[str, str]
    actor: Id
    after: tuple[Id, ...] = ()
    goal: Id | None = None
    duration_s: float = 0.0
    program: Program | None = None


class Making(Payload, frozen=True, kw_only=True):
    """How a plan was made.

    `rounds` counts answers of a language model, `tokens_in`, `tokens_out` and `cost_usd` add them
    up. `fallback` says why another planner than the one asked for made the plan.
    """

    planner: str = "symbolic"
    model: str | None = None
    rounds: int = 0
    tokens_in: int = 0
    tokens_out: int = 0
    cost_usd: float | None = None
    wall_s: float = 0.0
    fallback: str | None = None
    prompts: str | None = None
    """Version of the prompts that were used."""


class PlanChange(Payload, frozen=True, kw_only=True):
    """What a new revision did to the tasks that were not finished: how many of each."""

    kept: int = 0
    dropped: int = 0
    added: int = 0


class Plan(Payload, frozen=True, kw_only=True):
    """Goals, tasks, dependencies and actors.

    `revision` counts replans of the same plan from 1. `made_by` names planner and strategy.
    `conditions` are the facts that hold when the plan is done, goal by goal; `always` hold
    before and after each of its tasks, and `never` at no such time. What of `sometime_before` is
    second holds at no such time before which the first never did.
    `pins` maps actors to the robot that they must be; every other actor is free to allocate, but
    for tasks of goals in `by`, which only those robots do.
    """

    plan: Id
    revision: int = 1
    goals: tuple[Id, ...]
    conditions: tuple[Condition, ...]
    tasks: tuple[Task, ...]
    strategy: str = "big-dag"
    made_by: str = "symbolic"
    allocator: str = "makespan"
    pins: dict[str, Id] = {}
    autostart: bool = True
    making: Making = Making()
    seeks: tuple[Id, ...] = ()
    """Objects that this plan only looks for; once one is found, a new revision goes on."""
    programs: bool = False
    """Whether what an actor does in a row by itself is one task, carried out as a program."""
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()
    sometime_before: tuple[Precedence, ...] = ()
    by: dict[Id, tuple[Id, ...]] = {}
    proposed_by: Author = ""
    """Who put it there, where a person did."""

    @property
    def is_constrained(self) -> bool:
        """Whether it matters what holds on the way."""
        return bool(self.always or self.never or self.sometime_before)

    @property
    def actors(self) -> tuple[str, ...]:
        """Its actors, in the order of their first tasks."""
        return tuple(dict.fromkeys(task.actor for task in self.tasks))


class PlanState(str, Enum):
    """Where a plan stands."""

    PLANNING = "planning"
    PROPOSED = "proposed"
    """Checked and allocated; waits for a person's approval."""
    READY = "ready"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    REJECTED = "rejected"
    CANCELLED = "cancelled"


ENDED_PLANS = frozenset(
    {PlanState.SUCCEEDED, PlanState.FAILED, PlanState.REJECTED, PlanState.CANCELLED}
)
"""States that a plan does not leave."""


class Violation(Payload, frozen=True, kw_only=True):
    """One reason why a plan cannot be carried out: a sentence, and where to look."""

    code: str
    sentence: str
    task: Id | None = None
    condition: Condition | None = None


class PlanStatus(Payload, frozen=True, kw_only=True):
    """What the planner says of a plan.

    `allocation` maps actors to robots, `sequence` lists each robot's actors in their order.
    `reason` is a sentence where the plan failed, was rejected or cancelled.
    """

    plan: Id
    revision: int
    state: PlanState
    goals: tuple[Id, ...] = ()
    allocation: dict[str, str] = {}
    sequence: dict[str, tuple[str, ...]] = {}
    made_by: str = ""
    allocator: str = ""
    predicted_makespan_s: float | None = None
    lower_bound_s: float | None = None
    """This task graph cannot be done in less, by any robots in any order; where the allocator
    proved it."""
    mission_bound_s: float | None = None
    """No plan for these goals is shorter, whatever tasks it has; where tasks of the plan were under
    way when it was made, nothing is said."""
    notes: tuple[str, ...] = ()
    """What the allocator says of how it came to its answer."""
    planning_time_s: float | None = None
    making: Making = Making()
    change: PlanChange | None = None
    """What the latest revision changed."""
    reason: str | None = None
    violations: tuple[Violation, ...] = ()
    time_s: float = 0.0
    wall_time_s: float | None = None
    """When it was last changed, Unix time [s]."""
    waits_for: tuple[WaitReason, ...] = ()
    """What holds up the plan as a whole; its tasks have reasons of their own."""
    approved_by: str = ""
    """Who has approved it, such as `ana@lab`, where somebody had to."""
