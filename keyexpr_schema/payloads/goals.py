"""Payloads about goals."""

from __future__ import annotations

from enum import Enum

from msgspec.structs import replace

from keyexpr_schema.authors import Author
from keyexpr_schema.facts import FactKey, Literal, Value, render_value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.waits import WaitReason


class GoalAddress(Address, frozen=True):
    """One goal."""

    goal: str


class Condition(Payload, frozen=True, kw_only=True):
    """`relation(subject) = value` must hold, e.g. `at(cup_1) = hallway`.

    A goal `at(object) = place` holds of all that carries the object, however indirectly: it may be
    in a bowl on a table there, or in the basket of a robot that is there; it does not while a hand
    holds the object. `on(object)` and `in(object)` name the thing that carries it directly.
    `located(object) = true` holds when it is known where the object is, `held(object) = true` when
    a robot's hand holds it. With `any_of`, it is enough that the condition holds for one of those
    subjects (`subject` is then the first of them): "a cup", "some robot". One that is `negated`
    holds where the same one that is not does not: of `any_of`, for none of them. Only what a goal
    waits for, stands by for, or is wanted under can be.
    """

    relation: Id
    subject: Id
    value: Value
    any_of: tuple[Id, ...] = ()
    negated: bool = False

    @property
    def subjects(self) -> tuple[str, ...]:
        """Whom the condition may hold for."""
        return self.any_of or (self.subject,)

    @property
    def literals(self) -> tuple[Literal, ...]:
        """That it holds, for each of those whom it may hold for."""
        return tuple(Literal(FactKey(self.relation, s), self.value) for s in self.subjects)

    def __str__(self) -> str:
        equals = "!=" if self.negated else "="
        return f"{self.relation}({' or '.join(self.subjects)}) {equals} {render_value(self.value)}"


class Precedence(Payload, frozen=True, kw_only=True):
    """If ever `then` holds, `first` held strictly before: PDDL3's (sometime-before then first)."""

    first: Condition
    then: Condition

    def __str__(self) -> str:
        return f"{self.first} before {self.then}"


class Goal(Payload, frozen=True, kw_only=True):
    """A sentence, and the facts that must hold when it is done.

    With no `conditions` the planner reads them out of `text`. `due_s` is when it should be done, on
    the fleet's clock [s]; plans are made so that goals are as little late as can be. `said_s` is
    when it was said, on the same clock; 0: it does not say. The same words said again later, after
    the goal was deleted, are another wish. `speaker` is the person who says it: "me" in the text.
    Until it is reached `always` must hold all the time, of `never` nothing may, and of each
    `sometime_before` one condition only after the other held, from when it is planned on.

    It is not begun before `not_before_s` on the fleet's clock [s], then not before the goals
    `after` have ended, and then not until `when` holds; if `only_if` does not hold then, it is
    over. With `every`, a line of cron or an ISO 8601 period, it makes a goal at each of those
    times; with `whenever`, each time that all of it comes to hold; each of these is due as long
    after it begins as `due_s` is after `said_s`. `by` are the robots that shall
    do it, and no others.
    """

    goal: Id
    text: str
    conditions: tuple[Condition, ...] = ()
    priority: int = 0
    ordinal: int = 0
    """Order in which goals were given; ties in priority go to the lower one."""
    due_s: float | None = None
    said_s: float = 0.0
    speaker: Id | None = None
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()
    sometime_before: tuple[Precedence, ...] = ()
    meant: str | None = None
    """What the text means, of what it can mean: a candidate of `GoalStatus`."""
    when: tuple[Condition, ...] = ()
    only_if: tuple[Condition, ...] = ()
    not_before_s: float | None = None
    every: str | None = None
    by: tuple[Id, ...] = ()
    after: tuple[Id, ...] = ()
    said_at: str | None = None
    """What clocks showed there when it was said, in ISO 8601 with the offset from UTC: for times of
    day. It is the moment of `said_s`."""
    whenever: tuple[Condition, ...] = ()
    said_by: Author = ""
    """Who put it there, such as `ana@lab`."""
    zone: str | None = None
    """The time zone that its times of day are of, by its IANA name; without, the offset of
    `said_at` holds for good."""

    def wants_same(self, other: Goal) -> bool:
        """Whether another goal wants the same, however urgent it is, and whoever puts it."""
        urgency = {name: getattr(other, name) for name in ("priority", "due_s", "said_by")}
        return replace(self, **urgency) == other

    @property
    def constraints(self) -> tuple[Condition, ...]:
        """All conditions that say what may hold on the way."""
        in_order = (each for row in self.sometime_before for each in (row.first, row.then))
        return (*self.always, *self.never, *in_order)


class GoalState(str, Enum):
    """Where a goal stands."""

    READING = "reading"
    """A language model says the sentence in simpler words."""
    WAITING = "waiting"
    PLANNED = "planned"
    RUNNING = "running"
    REACHED = "reached"
    FAILED = "failed"
    REJECTED = "rejected"
    PENDING = "pending"
    """Its time has not come, or what has to hold first does not: it is planned when it does."""
    STANDING = "standing"
    """It is kept until somebody deletes it, or stands for several goals until these have ended."""
    NOT_NEEDED = "not-needed"
    """It was wanted only if something held, and that did not."""


ENDED_GOALS = frozenset(
    {GoalState.REACHED, GoalState.FAILED, GoalState.REJECTED, GoalState.NOT_NEEDED}
)
"""States that a goal does not leave."""
OVER_GOALS = ENDED_GOALS - {GoalState.REJECTED}
"""Of these, the ones in which nothing will happen to it any more: one that is rejected is read
again when there are other names, until somebody deletes it."""


class GoalStatus(Payload, frozen=True, kw_only=True):
    """What the planner says of a goal. `reason` is a sentence where it failed or was rejected.

    A goal that says "first …, then …" has several `stages`, reached one after the other;
    `conditions` are those of the stage that it is at, `stage` counts from 0. `note` is a sentence
    about words of the goal that are no part of what must hold: remarks that ask for nothing, and
    what it takes for granted against what is believed. `passed` are conditions that had to hold
    `sometime_before` others, and have. One that is pending says in `reason` what it waits for, and
    in `next_s` when something happens with it next, on the fleet's clock [s]. `parts` are goals
    that it has made and that have not ended; each is `part_of` it. `runs` counts them. Of a goal
    with `whenever`, `holds` says whether that held when it was last known, and `again` that it came
    to hold once more while what was made for it goes on. Of one with `every`, `queued_s` are times
    that have come and wait for the run before, `latest` is the last run, begun at `latest_s`;
    `missed` counts times that nobody was there for and that got no run of their own, `skipped`
    those at which the run before still went on. One that is `paused` begins nothing.

    Times: when the planner first heard of the goal as it is, and since when it stands so, each on
    the fleet's clock [s] and (`wall`) in Unix time [s].
    """

    goal: Id
    state: GoalState
    conditions: tuple[Condition, ...] = ()
    stages: tuple[tuple[Condition, ...], ...] = ()
    stage: int = 0
    plan: Id | None = None
    reason: str | None = None
    note: str | None = None
    passed: tuple[Condition, ...] = ()
    understood: str | None = None
    """What the sentence was understood as, said back in words made from what must hold."""
    candidates: tuple[str, ...] = ()
    """What the sentence can mean, where that is several things, or where a language model has said
    it in other words; somebody has to say which is meant."""
    refusal: str | None = None
    """Why the grammar does not take the sentence, where a language model was asked about it."""
    paraphrase: str | None = None
    """What the language model says in its place, in sentences that the grammar reads."""
    teaches: str | None = None
    """A task that the language model proposes, as a task file has it [YAML]: with it the grammar
    reads the sentence so by itself. That it can be done was seen by planning."""
    given_s: float | None = None
    given_wall_s: float | None = None
    time_s: float = 0.0
    wall_time_s: float | None = None
    next_s: float | None = None
    part_of: Id | None = None
    own: bool = False
    """Whether the planner has made it: there is no spec on a key."""
    parts: tuple[Id, ...] = ()
    runs: int = 0
    holds: bool = False
    again: bool = False
    paused: bool = False
    queued_s: tuple[float, ...] = ()
    latest: Id | None = None
    latest_s: float | None = None
    missed: int = 0
    skipped: int = 0
    waits_for: tuple[WaitReason, ...] = ()
    """Why nothing is done for it now. What holds up a goal that is running, its tasks say."""
    whenever: tuple[Condition, ...] = ()
    """What it stands by for, also where its sentence says so."""

    def still_in_order(self, goal: Goal) -> tuple[Precedence, ...]:
        """What of the goal has to hold before something else may, and has not yet."""
        if self.state in ENDED_GOALS:
            return ()
        return tuple(row for row in goal.sometime_before if row.first not in self.passed)
