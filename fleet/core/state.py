"""The planner's whole state: a value. `step` makes the next one; nothing else changes it."""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from fleet.core.indexes.fact_views import Carriers, FactValues, Resting, Whereabouts
from fleet.core.indexes.fleet_index import NO_FLEET, FleetIndex, index_of
from fleet.core.indexes.plan_index import EMPTY_INDEX
from fleet.core.indexes.touches import UNTOUCHED, Touches
from fleet.core.model.skills import SkillModel
from fleet.core.model.time_zones import Offsets, TimeZone, time_zone
from fleet.core.model.world import WorldModel
from fleet.core.plan_entry import PlanEntry, PlanningJob
from fleet.core.table import Table
from fleet.language import Confirm, Vocabulary
from fleet.language.methods.model import CompoundTask
from fleet.language.vocabulary import SkillPhrase, StateWord
from fleet.language.words.own_words import OwnWords
from fleet.language.words.wordbook import wordbook_of
from keyexpr_schema.facts import CHARGE, HOLDING, FactKey
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.goals import Goal, GoalStatus
from keyexpr_schema.payloads.history import Ended
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.schedules import Schedule
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement, StatementStatus

LOGIC = 12
"""Counts up whenever the core comes to handle an event otherwise than before."""


class Policy(msgspec.Struct, frozen=True, kw_only=True):
    """How the planner is to behave.

    `approval`: a person has to approve every new plan. `auto_plan`: goals that wait are planned
    without being asked for, into a running plan where there is one. `interpreter`: sentences that
    the grammar refuses go to a language model; `confirm` says which of its paraphrases a person has
    to confirm. `lost_after_s`: a robot whose worker is gone for
    longer (wall time, s) counts as lost, and a robot rests that has not heard of the planner for
    `lease_s` (0: orders need no lease). `planning_limit_s`: a plan has to be made within that many
    seconds. `skill_phrases` are skills that goals can ask for by name, and
    `state_words` words for states, `tasks` what people call by names of its own, `words` what a
    user adds to the words of the language, `relations` what skills bring about between two things.
    """

    approval: bool = False
    auto_plan: bool = False
    interpreter: bool = False
    confirm: Confirm = Confirm.ALWAYS
    lost_after_s: float = 30.0
    planning_limit_s: float = 120.0
    skill_phrases: tuple[SkillPhrase, ...] = msgspec.field(default=(), name="deeds")
    state_words: tuple[StateWord, ...] = ()
    tasks: tuple[CompoundTask, ...] = ()
    words: tuple[OwnWords, ...] = ()
    relations: tuple[str, ...] = ()
    lease_s: float = 0.0


class State(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What the planner knows."""

    skills: dict[str, SkillModel] = {}
    logic: int = 0
    """The logic that the planner's latest run handles events by."""
    lineage: str = ""
    """Names the journal that this state comes from; attempts of another planner have another."""
    epoch: int = 0
    incarnation: str = "none"
    era: int = 0
    """Counts up when the fleet's clock is set back; times of different eras do not compare."""
    time_s: float = 0.0
    wall_time_s: float = 0.0
    monotonic_s: float = 0.0
    """On a clock that nobody sets; see `Event.monotonic_s`."""
    goals: Table[str, Goal] = Table()
    """What people want, with all that their sentences say."""
    goal_specs: Table[str, Goal] = Table()
    """Of these, as they were put, those whose sentence adds something."""
    goal_states: Table[str, GoalStatus] = Table()
    schedules: Table[str, Schedule] = Table()
    """As they were put; what each wants is a goal of that name."""
    zones: Table[str, Offsets] = Table()
    """The time zones that goals speak of."""
    statements: Table[str, Statement] = Table()
    statement_states: Table[str, StatementStatus] = Table()
    places: Table[str, Place] = Table()
    objects: Table[str, Object] = Table()
    robots: Table[str, RobotSpec] = Table()
    facts: Table[FactKey, Fact] = Table()
    older_facts: Table[FactKey, None] = Table()
    """Variables whose fact was said in an earlier era."""
    received: Table[FactKey, int] = Table()
    """When the store received what is believed of each variable, by its own count [µs]."""
    last_received: int = 0
    """The highest receipt of all that was heard."""
    receipt: int = 0
    """That of the event under way; 0: it has none."""
    concluded: Table[FactKey, Fact] = Table()
    """What the planner itself concluded last of each variable, whatever is believed of it now."""
    durations: dict[str, Durations] = {}
    """Learned from reports, by type of robot."""
    connected: Table[str, tuple[str, ...]] = Table()
    """The runs of each robot's worker that are connected."""
    gone_since: Table[str, float] = Table()
    """When the last worker of a robot went away, on the clock of `monotonic_s`."""
    gone_wall_s: Table[str, float] = Table()
    """The same in Unix time [s], for people; nothing is decided by it."""
    stops: Table[str, Stop] = Table()
    """Emergency stops that stand."""
    released: Table[str, tuple[str, ...]] = Table()
    """Robots that a stop holds no longer, by stop."""
    holds: Table[str, Hold] = Table()
    """Pauses and drains that stand."""
    to_put_down: Table[str, str] = Table()
    """Things that may be in a hand for nobody, and what has come of whoever wanted them."""
    closures: Table[str, Closure] = Table()
    """Where robots do not drive, or one at a time; each until its time is over."""
    team_number: int = 0
    """Counts the times that a robot has come, or came to be planned with."""
    waiting_for_robots: Table[str, int] = Table()
    """Goals without a plan that no robot could help with, and `team_number` then; -1 for those that
    are planned at once without being asked for, since their time has come."""
    plans: Table[str, PlanEntry] = Table()
    past_plans: tuple[str, ...] = ()
    plans_made: int = 0
    """The highest number that a plan `plan-N` has had; names that the planner gives go on there."""
    attempts_made: int = 0
    """The serial of the latest attempt that was ordered."""
    answers: Table[str, Answer] = Table()
    jobs: int = 0
    previews: Table[str, PlanningJob] = Table()
    """Planning jobs of dry runs, by request."""
    interpreting: tuple[str, ...] = ()
    """Goals whose sentences a language model reads now."""
    policy: Policy = Policy()
    over: tuple[Ended, ...] = ()
    """What left the state in the latest event, because it is over."""
    index: FleetIndex = NO_FLEET
    touches: Touches = UNTOUCHED
    """What the event under way has changed so far; empty between two events."""

    @property
    def plans_while_acting(self) -> bool:
        """Whether a plan is made again while it is carried out, as since logic 1 of the core. In
        journals from before, it stood still, and of several reasons the last one counted."""
        return self.logic >= 1

    def vocabulary(self) -> Vocabulary:
        """The names that sentences can use."""
        around = Carriers(self.facts, self)
        return Vocabulary(
            self.places,
            self.objects,
            self.robots,
            Whereabouts(around, self.objects),
            Resting(self.facts, around, self.places, self.objects),
            self.policy.skill_phrases,
            around,
            believed=FactValues(self.facts),
            state_words=self.policy.state_words,
            tasks=self.policy.tasks,
            relations=self.policy.relations,
            language=wordbook_of(self.policy.words),
        )

    def time_zones(self) -> dict[str, TimeZone]:
        """The rules of the time zones that goals speak of."""
        return {name: time_zone(name, offsets) for name, offsets in self.zones.items()}

    def world(self) -> WorldModel:
        """The world as believed now: a view, which costs nothing to make."""
        return WorldModel(
            skills=self.skills,
            places=self.places,
            objects=self.objects,
            robots=self.robots,
            available=self.index.team,
            facts=FactValues(self.facts),
            durations=self.durations,
            closures=tuple(self.closures.values()) if self.closures else (),
        )

    def team(self) -> tuple[str, ...]:
        """The robots that can be planned with, in a fixed order."""
        return tuple(sorted(self.index.team))

    def stops_of(self, robot: str) -> list[str]:
        """The emergency stops that hold a robot still, by name."""
        return [
            name
            for name, stop in self.stops.items()
            if stop.names(robot) and robot not in self.released.get(name, ())
        ]

    def stopped(self, robot: str) -> bool:
        """Whether an emergency stop holds a robot still."""
        return bool(self.stops_of(robot))

    def draining(self, robot: str) -> Hold | None:
        """The drain that takes a robot out, if there is one; it may still carry something."""
        drains = (hold for hold in self.holds.values() if hold.kind is HoldKind.DRAIN)
        return next((hold for hold in drains if robot in hold.robots), None)

    def drained(self, robot: str) -> bool:
        """Whether a robot is taken out of planning: nothing is left that it carries."""
        return self.draining(robot) is not None and robot not in self.index.things_at

    def is_empty(self, robot: str) -> bool:
        """Whether nothing is left in a robot's battery: it stays where it is."""
        charge = self.fact(CHARGE, robot)
        return charge is not None and charge.value == 0 and charge.value is not False

    def ready(self, robot: str) -> bool:
        """Whether a robot can be planned with: connected, not drained, its battery not empty, and
        what its hand holds is known."""
        spec = self.robots.get(robot)
        if spec is None or not self.connected.get(robot) or self.drained(robot):
            return False
        if self.is_empty(robot):
            return False
        return "grip" not in spec.capabilities or self.fact(HOLDING, robot) is not None

    def fact(self, relation: str, subject: str) -> Fact | None:
        """The fact about a variable, if there is one."""
        return self.facts.get(FactKey(relation, subject))

    def bare(self) -> State:
        """The state without what is derived: what is kept of it. `reindexed` is the way back."""
        plans = Table(
            {plan: replace(entry, index=EMPTY_INDEX) for plan, entry in self.plans.items()}
        )
        return replace(self, plans=plans, index=NO_FLEET, touches=UNTOUCHED)

    def reindexed(self) -> State:
        """The state with everything derived anew, as after it was read or got other skills."""
        plans = Table(
            {plan: entry.indexed(None, self.skills) for plan, entry in self.plans.items()}
        )
        team = sorted(robot for robot in self.connected if self.ready(robot))
        index = index_of(plans, self.goals, self.goal_states, self.facts, self.objects, team)
        return replace(self, plans=plans, index=index)
