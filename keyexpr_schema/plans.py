"""Payloads about plans: a DAG of tasks, each done by an actor."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.goals import Condition
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class PlanAddress(Address, frozen=True):
    """One plan."""

    plan: str


class Task(Payload, frozen=True, kw_only=True):
    """One skill call.

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


class Plan(Payload, frozen=True, kw_only=True):
    """Goals, tasks, dependencies and actors.

    `revision` counts replans of the same plan from 1. `made_by` names planner and strategy.
    `conditions` are the facts that hold when the plan is done, goal by goal.
    `pins` maps actors to the robot that they must be; every other actor is free to allocate.
    """

    plan: Id
    revision: int = 1
    goals: tuple[Id, ...]
    conditions: tuple[Condition, ...]
    tasks: tuple[Task, ...]
    strategy: str = "big-dag"
    made_by: str = "symbolic"
    allocator: str = "milp"
    pins: dict[str, Id] = {}
    autostart: bool = True


class PlanState(str, Enum):
    """Where a plan stands."""

    PLANNING = "planning"
    READY = "ready"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    REJECTED = "rejected"
    CANCELLED = "cancelled"


ENDED_PLANS = frozenset(
    {PlanState.SUCCEEDED, PlanState.FAILED, PlanState.REJECTED, PlanState.CANCELLED}
)


class Violation(Payload, frozen=True, kw_only=True):
    """One reason why a plan cannot be carried out: a sentence, and where to look."""

    code: str
    sentence: str
    task: Id | None = None
    condition: Condition | None = None


class PlanStatus(Payload, frozen=True, kw_only=True):
    """What the planner says of a plan.

    `allocation` maps actors to robots, `sequence` lists each robot's actors in their order.
    `reason` is a sentence where the plan failed or was rejected.
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
    planning_time_s: float | None = None
    reason: str | None = None
    violations: tuple[Violation, ...] = ()
    time_s: float = 0.0
