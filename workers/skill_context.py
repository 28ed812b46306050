"""`SkillContext`: what a skill may use: a robot, the known world, and a clock."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.facts import (
    AT,
    BLOCKED_BY,
    HOLDING,
    IS_OPEN,
    NOTHING,
    ON,
    FactKey,
    Literal,
    Value,
)
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
    PointM,
    Senses,
)
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.world import Fact, FactAddress
from workers.embodiment import Embodiment
from workers.errors import Observation, SkillFailed
from workers.host_clock import running_s
from workers.seen_facts import SeenFacts
from workers.world_cache import WorldCache


class SkillContext:
    """One attempt's view of robot and world.

    What is observed is kept over all tries of the attempt, the later value in place of the earlier,
    and goes out as facts just before the final report.
    """

    def __init__(
        self,
        spec: RobotSpec,
        embodiment: Embodiment,
        world: WorldCache,
        seen: SeenFacts | None = None,
    ) -> None:
        """`seen` gets what is observed; it has what attempts before have."""
        self.robot: str = spec.robot
        self.spec = spec
        self.embodiment = embodiment
        self.world = world
        self._observed: dict[FactKey, Fact] = {}
        self._seen = SeenFacts() if seen is None else seen
        self._aboard: set[str] = set()
        """What this attempt has seen in the robot's own basket, which may have no sensor."""
        self._log = logging.getLogger(f"robotfleet.worker.{spec.robot}")

    @property
    def now_s(self) -> float:
        """Seconds on the fleet's clock."""
        return self.embodiment.now_s()

    @property
    def observed(self) -> tuple[Fact, ...]:
        """The facts observed in this attempt so far."""
        return tuple(self._observed.values())

    def observe(self, relation: str, subject: str, value: Value) -> None:
        """Note that `relation(subject)` is `value` now; `None` says that it is unknown.

        That a thing is not where it was thought to be is as old as that belief: it says nothing
        against another robot that has seen it elsewhere meanwhile.

        Raises:
            SchemaError: nobody could read that, and no journal of the worker's either.
        """
        variable = FactKey(relation, subject)
        if relation == AT and value is None:
            said = (self.world.facts.get(variable), self._own_word(variable))
            self._deny(subject, [word for word in said if word is not None])
        else:
            self._note(Literal(variable, value), self.now_s, running_s())

    def _deny(self, thing: str, words: Sequence[Fact]) -> None:
        """Note that a thing is not where these say: as of when the last of them was said, and was
        heard or observed here; as of now, where nobody has said."""
        literal, now_s = Literal(FactKey(AT, thing), None), self.now_s
        said_s = max((word.time_s for word in words), default=0.0) or now_s
        seen_s = [at_s for word in words if (at_s := self._known_s(word)) is not None]
        self._note(literal, min(now_s, said_s), max(seen_s, default=running_s()))

    def _known_s(self, word: Fact) -> float | None:
        """When a word was observed, else heard, here, by `running_s`."""
        seen_s, heard_s = self._seen.seen_s(word), self.world.heard_s
        if seen_s is None and word == self.world.facts.get(word.key):
            return heard_s.get(word.key)
        return seen_s

    def _note(self, literal: Literal, said_s: float, seen_s: float) -> None:
        fact = Fact.of(literal, self.robot, said_s)
        FACT.check(fact, FactAddress.of(fact.key))
        self._observed[literal.variable] = fact
        self._seen.note(fact, seen_s)

    def observe_missing(self, thing: str, place: str) -> None:
        """Note that a thing is not to be seen in `place`; nothing, where it is not thought to be
        there any more: who has said meanwhile where else it is may be right."""
        known = self._words(AT, thing)
        places = [(self.world.place_of(_name(word.value)), word) for word in known]
        wrong = [word for at, word in places if at is None or self.world.within(at, place)]
        if wrong or not known:
            self._deny(thing, wrong)

    def observe_not_at(self, thing: str, where: str) -> None:
        """Note that a thing is not at `where`, if it is thought to be."""
        if wrong := [word for word in self._words(AT, thing) if word.value == where]:
            self._deny(thing, wrong)

    def _own_word(self, variable: FactKey) -> Fact | None:
        """What this attempt has observed last of a variable, else one before it, of which the
        store may not have heard yet."""
        return self._observed.get(variable) or self._seen.last(variable)

    def recall(self, facts: Iterable[Fact]) -> None:
        """Take over what an earlier run of the worker had observed in this attempt."""
        self._observed.update((fact.key, fact) for fact in facts)

    def observe_failure(self, failure: SkillFailed) -> None:
        """Take over the facts that a failure brought; one that nobody could read is left out."""
        for relation, subject, value in failure.facts:
            try:
                self.observe(relation, subject, value)
            except SchemaError as error:
                self._log.error("%s", error)

    def log(self, sentence: str) -> None:
        """Tell the person who watches this worker's output."""
        self._log.info("%s", sentence)

    def robot_pose(self, robot: str) -> PoseMRad | None:
        """Another robot's `(x [m], y [m], yaw [rad])`, world frame, as its worker published it."""
        state = self.world.robots.get(robot)
        return None if state is None else state.pose_m_rad

    async def do(
        self,
        kind: MotionKind,
        *,
        place: str | None = None,
        object: str | None = None,
        robot: str | None = None,
        point_m: PointM | None = None,
        timeout_s: float = 120.0,
    ) -> MotionOutcome:
        """Perform one motion; returns when it has succeeded.

        Raises:
            SkillFailed: it failed or was stopped, with the driver's own sentence; retryable unless
                the driver says otherwise, or something that is open is in the way: then a fact.
        """
        motion = Motion(
            kind=kind,
            place=place,
            object=object,
            robot=robot,
            point_m=point_m,
            timeout_s=timeout_s,
        )
        outcome = await self.embodiment.perform(motion)
        if outcome.state is not MotionState.SUCCEEDED:
            reason = outcome.reason or f"{kind.value} {outcome.state.value} without a reason"
            blocked = self._blocked(object, outcome.blocked_by)
            again = outcome.retryable and not blocked
            raise SkillFailed(reason, retryable=again, facts=blocked)
        return outcome

    def _blocked(self, object: str | None, by: str | None) -> tuple[Observation, ...]:
        """The facts that `by` is open and in the way of the furniture that a motion was about."""
        around = () if object is None else (object, *self.world.carriers(object))
        about = next((n for n in around if n in self.world.objects and not self.world.moves(n)), by)
        if by is None or about is None or about == by:
            return ()
        return ((BLOCKED_BY, about, by), (IS_OPEN, by, True))

    async def look(self) -> tuple[Detection, ...]:
        """Look around. What is seen elsewhere than the facts say, or on another support, or in
        another state, is a fact.

        Raises:
            SkillFailed: the camera gave nothing.
        """
        seen = (await self.do(MotionKind.LOOK)).detections
        for detection in seen:
            name = detection.object
            for state, value in detection.states.items():
                if not self._is_known(state, name, value):
                    self.observe(state, name, value)
            if not self.world.moves(name):
                continue
            where = self.world.whereabouts(detection)
            (self._aboard.add if where == self.robot else self._aboard.discard)(name)
            if where is not None and not self._is_known(AT, name, where):
                self.observe(AT, name, where)
            # On or in a thing or in a basket it is at that, which says all; `on` is of furniture
            # that is no thing and of the floor.
            if where in self.world.places:
                if not self._is_known(ON, name, detection.support):
                    self.observe(ON, name, detection.support)
            elif where is not None and not self._is_known(ON, name, None):
                self.observe(ON, name, None)
        return seen

    async def holding(self) -> str | None:
        """The object in the hand, by the hand's own sensor; observed as a fact."""
        return self.observe_carried(await self.embodiment.senses())

    def observe_carried(self, senses: Senses, *about: str) -> str | None:
        """Note what the hand holds, and what it holds no more, `about` these too; the object in the
        hand.

        What was thought to be with the robot, and is in neither hand nor basket now, by its sensor
        or by what eyes have seen, is where nobody knows, until somebody sees it: to say of the hand
        alone that it is empty would leave the thing with the robot.
        """
        held, thought = senses.holding, self._thought_carried(senses, *about)
        # First of the hand: what is with the robot besides is said of the same moment or later.
        self.observe(HOLDING, self.robot, NOTHING if held is None else held)
        aboard = {*senses.basket, *(() if senses.basket_sensor else self._aboard)}
        for thing in thought:
            if thing != held and thing in aboard:
                self.observe(AT, thing, self.robot)
            elif thing != held:
                self.observe_not_at(thing, self.robot)
        if held is not None:
            self._aboard.discard(held)
            self.observe(AT, held, self.robot)
            if not self._is_known(ON, held, None):
                self.observe(ON, held, None)
        return held

    def _thought_carried(self, senses: Senses, *about: str) -> tuple[str, ...]:
        """What this attempt has seen with the robot, or is said to be in its hand: all that is said
        to be with a robot that has a hand, and no basket or one with a sensor. What it has seen
        there, and somebody else has elsewhere since, it does not say any more."""
        things = self._with_robot(self._observed.values())
        for thing in things:
            if self.known(AT, thing) != self.robot:
                del self._observed[FactKey(AT, thing)]
        all_told = senses.basket_sensor or "basket" not in self.spec.capabilities
        if "grip" in self.spec.capabilities and all_told:
            things += self._with_robot((*self.world.facts.values(), *self._seen.all_last()))
        else:
            held = (word.value for word in self._words(HOLDING, self.robot))
            things += [thing for thing in held if isinstance(thing, str)]
        return tuple(filter(self.is_carried, dict.fromkeys((*things, *about))))

    def _with_robot(self, said: Iterable[Fact]) -> list[str]:
        return [each.subject for each in said if (each.relation, each.value) == (AT, self.robot)]

    def is_carried(self, thing: str) -> bool:
        """Whether a thing may be thought to be with the robot, in hand or basket: by what it has
        seen itself, if nobody else has said since where it is, who may have taken it."""
        return any(word.value == self.robot for word in self._words(AT, thing))

    async def has_hand_for(self, object: str) -> bool:
        """Whether the hand is empty; not if it holds `object` already, from an earlier try.

        Raises:
            SkillFailed: it holds something else.
        """
        held = await self.holding()
        if held not in (None, object):
            raise SkillFailed(
                f"{self.robot} holds {held} already, one hand cannot take {object} too",
                retryable=False,
            )
        return held is None

    def observe_taken(self, object: str, held: str | None, where: str) -> None:
        """Note what came of a grasp, after which the hand holds `held`.

        Raises:
            SkillFailed: it is not the object.
        """
        if held != object:
            self.observe(AT, object, None)
            raise SkillFailed(f"{object} was grasped {where} but slipped out of the hand")
        self.observe(HOLDING, self.robot, object)
        self.observe(AT, object, self.robot)

    async def be_in(self, place: str) -> Senses:
        """Make sure that the robot stands in `place`; drives there if it does not.

        A robot that waits may be pushed aside by traffic, over a border even, so that a plan's
        `at(robot) = place` does not hold any more when its next task starts.

        Raises:
            SkillFailed: the way is not open.
        """
        senses = await self.embodiment.senses()
        if not self.world.within(senses.place, place):
            self.log(f"is in {senses.place or 'no place'}, not in {place}: goes there first")
            senses = (await self.do(MotionKind.GO_TO, place=place)).senses
        self.observe(AT, self.robot, senses.place or place)
        return senses

    def known(self, relation: str, subject: str) -> Value:
        """What was said last of `relation(subject)`, by this worker or by others, as far as they
        are heard; what an earlier run of the worker had observed in this attempt is later than
        their word."""
        return next((word.value for word in self._words(relation, subject)), None)

    def _is_known(self, relation: str, subject: str, value: Value) -> bool:
        """Whether that is so by all that may come to be the last word of it."""
        words = self._words(relation, subject)
        return all(word.value == value for word in words) if words else value is None

    def _words(self, relation: str, subject: str) -> tuple[Fact, ...]:
        """What may be the last word of `relation(subject)`, first what is known.

        What waits in the journal is as old as when it was seen, and the store takes it in if it has
        received nothing since: which of the two is later, that or what others were heard to say
        after it was seen, the store alone can tell. It may have passed here late, as at a start.
        """
        variable = FactKey(relation, subject)
        seen, said = self._own_word(variable), self.world.facts.get(variable)
        if seen is None or said is None:
            return tuple(word for word in (seen, said) if word is not None)
        seen_s = self._seen.seen_s(seen)
        heard_s = self.world.heard_s.get(variable, 0.0)
        if said.source == self.robot or seen_s is None or heard_s <= seen_s:
            return (seen,)
        return (said, seen) if self._seen.waits(variable) else (said,)

    def closed_around(self, object: str) -> str | None:
        """The closed thing that an object is in, by what is known; `None`: nothing is closed."""
        return next(
            (
                carrier
                for carrier in self.world.carriers(object)
                if self.world.closed(carrier) and self.known(IS_OPEN, carrier) is not True
            ),
            None,
        )


def _name(value: Value) -> str | None:
    return value if isinstance(value, str) else None
