"""The planner's whole state: a value. `step` makes the next one; nothing else changes it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

import msgspec

from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.language import Vocabulary
from fleet.language.vocabulary import SkillPhrase
from keyexpr_schema.facts import AT, HOLDING, ON, FactKey
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.goals import Goal, GoalStatus
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanChange, PlanState, Task, Violation
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement, StatementStatus

K = TypeVar("K")
T = TypeVar("T")

OUTSTANDING = frozenset({TaskState.ORDERED, TaskState.RUNNING})


class Policy(msgspec.Struct, frozen=True, kw_only=True):
    """How the planner was told to behave.

    `approval`: a person has to approve every new plan. `auto_plan`: goals that wait are planned
    without being asked for, into a running plan where there is one. `interpreter`: sentences that
    the grammar refuses go to a language model. `lost_after_s`: a robot whose worker is gone for
    longer (wall time, s) counts as lost. `skill_phrases` are skills that goals can ask for by name.
    """

    approval: bool = False
    auto_plan: bool = False
    interpreter: bool = False
    lost_after_s: float = 30.0
    skill_phrases: tuple[SkillPhrase, ...] = msgspec.field(default=(), name="deeds")


class PlanningJob(msgspec.Struct, frozen=True, kw_only=True):
    """Planning to be done outside the core: for goals, or of a plan that someone proposed."""

    job: int
    plan: str
    revision: int
    goals: tuple[str, ...]
    strategy: str
    planner: str
    allocator: str
    first_task: int
    proposal: Plan | None = None
    request: str | None = None
    dry_run: bool = False
    partial: bool = False
    """Whether goals that cannot be reached are left out, and not the whole plan refused."""
    remaining: Plan | None = None
    """What is left of the plan, where that may do, with goals planned alone that it fails."""
    outside: bool = False
    """Whether nothing speaks against the plan, so that another allocation of what is left does."""
    home: dict[str, str] = {}
    """The robot of each actor until now."""
    sequence: tuple[str, ...] = ()
    """The actors in the order in which they were to begin."""
    begun: tuple[str, ...] = ()
    """Actors that their robots have begun to be."""
    running: tuple[str, ...] = ()
    """Tasks of the plan that were under way when the job was given."""
    reason: str | None = None
    """Why the plan is made again."""


class PlanEntry(msgspec.Struct, frozen=True, kw_only=True):
    """A plan with everything the planner keeps about it.

    `records` hold the tasks of every revision; `plan` only those of the current one.
    `replan_reason` set means: order nothing more, and plan again. What is left is mended, if that
    can be, unless it is also `anew_reason`. If it is also `outside_reason`, it says nothing against
    the plan: robots came, went or are late, a goal was deleted. `dropping` are tasks that are under
    way and no longer wanted; their orders are cancelled. `team` are the robots that were there when
    the plan was made. `late` are tasks that took far longer than predicted, and were reacted to.
    `failures` counts the tasks of each goal that failed for good.
    """

    plan: Plan
    state: PlanState
    planner: str = "symbolic"
    start: bool = True
    records: dict[str, TaskRecord] = {}
    allocation: dict[str, str] = {}
    sequence: dict[str, tuple[str, ...]] = {}
    job: PlanningJob | None = None
    replan_reason: str | None = None
    anew_reason: str | None = None
    outside_reason: str | None = None
    late: tuple[str, ...] = ()
    failures: dict[str, int] = {}
    amendment: Task | None = None
    """A task that someone wants added, and the request for it."""
    amendment_request: str | None = None
    dropping: tuple[str, ...] = ()
    team: tuple[str, ...] = ()
    change: PlanChange | None = None
    replans: int = 0
    cancelling: bool = False
    reason: str | None = None
    violations: tuple[Violation, ...] = ()
    makespan_s: float | None = None
    lower_bound_s: float | None = None
    notes: tuple[str, ...] = ()
    planning_time_s: float | None = None
    changed_s: float = 0.0

    @property
    def ended(self) -> bool:
        """Whether nothing will happen to this plan any more."""
        return self.state in ENDED_PLANS

    def current(self) -> Iterator[TaskRecord]:
        """The records of the current revision's tasks."""
        return (self.records[task.task] for task in self.plan.tasks if task.task in self.records)

    def outstanding(self) -> list[TaskRecord]:
        """Tasks that a robot has been told to do and has not ended."""
        return [record for record in self.records.values() if record.state in OUTSTANDING]


class State(msgspec.Struct, frozen=True, kw_only=True):
    """What the planner knows."""

    epoch: int = 0
    incarnation: str = "none"
    time_s: float = 0.0
    wall_time_s: float = 0.0
    goals: dict[str, Goal] = {}
    goal_states: dict[str, GoalStatus] = {}
    statements: dict[str, Statement] = {}
    understood: dict[str, StatementStatus] = {}
    places: dict[str, Place] = {}
    objects: dict[str, Object] = {}
    robots: dict[str, RobotSpec] = {}
    facts: dict[FactKey, Fact] = {}
    durations: dict[str, Durations] = {}
    """Learned from reports, by type of robot."""
    alive: dict[str, tuple[str, ...]] = {}
    gone_since: dict[str, float] = {}
    """Unix time [s] at which the last worker of a robot went away."""
    plans: dict[str, PlanEntry] = {}
    past_plans: tuple[str, ...] = ()
    answers: dict[str, Answer] = {}
    jobs: int = 0
    previews: dict[str, PlanningJob] = {}
    """Planning jobs of dry runs, by request."""
    interpreting: tuple[str, ...] = ()
    """Goals whose sentences a language model reads now."""
    policy: Policy = Policy()

    def vocabulary(self) -> Vocabulary:
        """The names that sentences can use."""
        whereabouts = {
            fact.subject: fact.value
            for fact in self.facts.values()
            if fact.relation == AT and isinstance(fact.value, str)
        }
        rooms = {s.surface: p.place for p in self.places.values() for s in p.surfaces}
        rests: dict[str, str] = {}
        for fact in self.facts.values():
            where = whereabouts.get(fact.subject)
            # What it lay on says nothing any more once it was taken to another place.
            if fact.relation != ON or where not in self.places:
                continue
            if isinstance(fact.value, str) and rooms.get(fact.value, where) == where:
                rests[fact.subject] = fact.value
        phrases = self.policy.skill_phrases
        return Vocabulary(self.places, self.objects, self.robots, whereabouts, rests, phrases)

    def world(self, skills: Mapping[str, SkillModel]) -> WorldModel:
        """The world as believed now."""
        return WorldModel.of(
            skills,
            self.places.values(),
            self.objects.values(),
            self.robots.values(),
            self.facts.values(),
            available=self.team(),
            durations=self.durations,
        )

    def team(self) -> tuple[str, ...]:
        """The robots that can be planned with, in a fixed order."""
        return tuple(sorted(robot for robot in self.alive if self.ready(robot)))

    def ready(self, robot: str) -> bool:
        """Whether a robot can be planned with: connected, and what its hand holds is known."""
        spec = self.robots.get(robot)
        if spec is None or not self.alive.get(robot):
            return False
        return "grip" not in spec.capabilities or self.fact(HOLDING, robot) is not None

    def fact(self, relation: str, subject: str) -> Fact | None:
        """The fact about a variable, if there is one."""
        return self.facts.get(FactKey(relation, subject))


def encode_state(state: State) -> bytes:
    """The state as JSON, with `subject/relation` for the key of a fact, as in the key-space."""
    return msgspec.json.encode(state, enc_hook=lambda key: f"{key.subject}/{key.relation}")


def decode_state(data: bytes) -> State:
    """The state that `encode_state` wrote.

    Raises:
        msgspec.DecodeError: it is none, or one of a version that kept something else.
    """
    fields = msgspec.json.decode(data, type=dict[str, msgspec.Raw])
    facts = msgspec.json.decode(fields.pop("facts", msgspec.Raw(b"{}")), type=dict[str, Fact])
    state = msgspec.json.decode(msgspec.json.encode(fields), type=State)
    return msgspec.structs.replace(state, facts={fact.key: fact for fact in facts.values()})


def put(mapping: Mapping[K, T], key: K, value: T) -> dict[K, T]:
    """A copy of `mapping` with one entry set."""
    return {**mapping, key: value}


def without(mapping: Mapping[K, T], key: K) -> dict[K, T]:
    """A copy of `mapping` with one entry left out."""
    return {name: value for name, value in mapping.items() if name != key}
