"""`Backend`: one shared simulated world, whatever carries it out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.simulation import ContactCount, Frame, Scene, Truth
from keyexpr_schema.payloads.world import Feature
from sim.batteries import Batteries, Use
from sim.errors import there_are
from sim.files.world_payloads import object_payloads
from sim.files.world_schema import WorldFile

NEEDS: dict[MotionKind, tuple[str, ...]] = {
    MotionKind.GO_TO: ("place",),
    MotionKind.LOOK: (),
    MotionKind.APPROACH: ("point_m",),
    MotionKind.GRASP: ("object", "point_m"),
    MotionKind.RELEASE: ("point_m",),
    MotionKind.RELEASE_IN_BASKET: ("robot",),
    MotionKind.STOW: (),
    MotionKind.PLACE_AT: ("object",),
    MotionKind.HAND_OVER: ("object",),
    MotionKind.OPEN: ("object",),
    MotionKind.CLOSE: ("object",),
    MotionKind.SWITCH_ON: ("object",),
    MotionKind.SWITCH_OFF: ("object",),
    MotionKind.CHARGE: ("object",),
}
"""The fields of a motion that its kind cannot do without."""

FEATURES: dict[MotionKind, tuple[Feature, ...]] = {
    MotionKind.GRASP: (Feature.MOVABLE,),
    MotionKind.PLACE_AT: (Feature.SUPPORTS, Feature.CONTAINS),
    MotionKind.HAND_OVER: (Feature.PERSON,),
    MotionKind.OPEN: (Feature.OPENABLE,),
    MotionKind.CLOSE: (Feature.OPENABLE,),
    MotionKind.SWITCH_ON: (Feature.SWITCHABLE,),
    MotionKind.SWITCH_OFF: (Feature.SWITCHABLE,),
}
"""Of which the thing that a motion names must have one."""


class Backend(ABC):
    """One shared simulated world. Synchronous, single-threaded, knows no clock but its own.

    The public methods check their arguments and call the abstract ones. What a robot cannot do
    becomes a failed outcome with a sentence, never an exception.

    Raises:
        KeyError: any method, for a robot that is not one of `robots`.
    """

    time_s: float
    """Simulated seconds since the start."""

    def __init__(
        self, world: WorldFile, robots: Sequence[RobotSpec], charge: Mapping[str, float] = {}
    ) -> None:
        """`charge` says how full batteries are at the start [%], where they are not full."""
        self.world = world
        self.robots = tuple(spec.robot for spec in robots)
        self.batteries = Batteries(robots, charge)
        self.things = {thing.object: thing for thing in object_payloads(world)}
        """Movable ones first, each kind in the order of the world file."""
        self.time_s = 0.0
        self._refused: dict[str, str] = {}
        self.held: frozenset[str] = frozenset()
        """Robots that stay where they are; see `hold`."""
        self._halting: set[str] = set()
        """Robots that were halted and do not rest yet."""

    def begin(self, robot: str, motion: Motion) -> None:
        """Start `motion`; what the robot was doing is stopped first."""
        self._check_robot(robot)
        self._stop(robot)
        self._halting.discard(robot)
        reason = self._objection(robot, motion)
        if reason is None:
            self._refused.pop(robot, None)
            self._begin(robot, motion)
        else:
            self._refused[robot] = reason

    def stop(self, robot: str) -> None:
        """Halt the robot: it brakes, and makes way for nobody before it `rests`. The outcome of
        what it was doing, if it still was, becomes `stopped`."""
        self._check_robot(robot)
        if robot not in self._refused:
            self._stop(robot)
        self._halt(robot)

    def rests(self, robot: str) -> bool:
        """Whether it does nothing, and nothing of it moves any more of what was halted."""
        self._check_robot(robot)
        return robot not in self._halting and not self.is_running(robot)

    def _halt(self, robot: str) -> None:
        if not self._stands(robot):
            self._halting.add(robot)

    def hold(self, robot: str, held: bool) -> None:
        """From now on it stays where it is, whoever wants to get past, or makes way again. Begins
        and ends no motion."""
        self._check_robot(robot)
        self.held = self.held | {robot} if held else self.held - {robot}

    def outcome(self, robot: str) -> MotionOutcome | None:
        """How the robot's latest motion stands or ended; `None` if it never moved."""
        self._check_robot(robot)
        if robot in self._refused:
            return MotionOutcome(
                state=MotionState.FAILED, senses=self._senses(robot), reason=self._refused[robot]
            )
        return self._outcome(robot)

    def is_running(self, robot: str) -> bool:
        """Whether the robot's latest motion has begun and not ended; costs less than `outcome`."""
        return robot not in self._refused and self._runs_still(robot)

    def senses(self, robot: str) -> Senses:
        """What the robot knows of itself."""
        self._check_robot(robot)
        return self._senses(robot)

    @abstractmethod
    def advance(self) -> None:
        """Let the world go on for one step: a control period, or to the next event."""

    def _pass_until(self, time_s: float) -> None:
        """Set the clock; batteries run down and fill. A robot whose battery runs empty stops where
        it is, and moves no more."""
        emptied = self.batteries.advance(time_s - self.time_s, self._use)
        self.time_s = time_s
        self._halting = {robot for robot in self._halting if not self._stands(robot)}
        for robot in emptied:
            if self.is_running(robot):
                self.stop(robot)
                self._refused[robot] = _empty(robot)

    def _taken(self, charger: str, robot: str) -> str | None:
        """Why a robot cannot dock at a charger; `None`: nobody is there."""
        others = (other for other in self.robots if other != robot)
        there = next((other for other in others if self._charges_at(other) == charger), None)
        return None if there is None else f"{charger} is taken: {there} charges there"

    def _still(self) -> frozenset[str]:
        """Those who make way for nobody: they are held, brake, or have nothing left to drive
        with."""
        empty = (robot for robot in self.robots if self.batteries.charge(robot) == 0.0)
        return self.held.union(self._halting, empty)

    @abstractmethod
    def _use(self, robot: str) -> Use:
        """What a robot does with its battery now."""

    @abstractmethod
    def _charges_at(self, robot: str) -> str | None:
        """The charger that a robot is docked at."""

    @abstractmethod
    def close(self, closures: Sequence[Closure]) -> None:
        """From now on exactly these are where robots do not drive: who is on the way through goes
        around, or its motion fails with the reason."""

    @abstractmethod
    def truths(self) -> tuple[Truth, ...]:
        """Where every object really is, and how everything is that has states, as in `things`."""

    def at_rest(self) -> bool:
        """Whether nothing rolls, slides or falls; what a hand holds moves with its robot."""
        return all(truth.settled or truth.held_by is not None for truth in self.truths())

    @abstractmethod
    def contacts(self) -> ContactCount:
        """How often robots touched each other or walls since the start."""

    @abstractmethod
    def scene(self) -> Scene:
        """The shapes of everything."""

    @abstractmethod
    def frame(self) -> Frame:
        """Where everything that moves is now."""

    @abstractmethod
    def _begin(self, robot: str, motion: Motion) -> None:
        """As `begin`, with a motion that has what its kind needs and names only what exists."""

    @abstractmethod
    def _stop(self, robot: str) -> None:
        """As `stop`; a robot that does nothing stays as it is."""

    @abstractmethod
    def _stands(self, robot: str) -> bool:
        """Whether neither its base nor its arm nor its hand moves."""

    @abstractmethod
    def _runs_still(self, robot: str) -> bool: ...

    @abstractmethod
    def _outcome(self, robot: str) -> MotionOutcome | None: ...

    @abstractmethod
    def _senses(self, robot: str) -> Senses: ...

    def _check_robot(self, robot: str) -> None:
        if robot not in self.robots:
            raise KeyError(f"there is no robot {robot!r}; {there_are(self.robots, robot)}")

    def _objection(self, robot: str, motion: Motion) -> str | None:
        """Why the motion makes no sense in this world, or `None`."""
        if self.batteries.is_empty(robot):
            return _empty(robot)
        kind = motion.kind.value
        for field in NEEDS[motion.kind]:
            if getattr(motion, field) is None:
                return f"{kind} needs `{field}`, which says {_ABOUT[field]}"
        places, objects = self.world.place_entries, self.things
        if motion.place is not None and motion.place not in places:
            return f"there is no place {motion.place!r}; {there_are(places, motion.place)}"
        if motion.object is not None and motion.object not in objects:
            return f"there is no object {motion.object!r}; {there_are(objects, motion.object)}"
        wanted = FEATURES.get(motion.kind, ())
        if motion.object is not None and wanted:
            thing = objects[motion.object]
            if not any(thing.is_a(feature) for feature in wanted):
                able = [n for n, t in objects.items() if any(t.is_a(f) for f in wanted)]
                return (
                    f"{motion.object} is not something to {_DOES[motion.kind]}; "
                    f"{there_are(able, motion.object)}"
                )
        if motion.kind is MotionKind.CHARGE:
            if self.batteries.battery(robot) is None:
                return f"{robot} has no battery to charge"
            chargers = self.world.fixtures.chargers
            if motion.object not in chargers:
                return f"{motion.object} is no charger; {there_are(chargers, str(motion.object))}"
        if motion.robot is not None and motion.robot not in self.robots:
            return f"there is no robot {motion.robot!r}; {there_are(self.robots, motion.robot)}"
        if motion.kind is MotionKind.RELEASE_IN_BASKET and motion.robot == robot:
            return "a robot cannot let go into its own basket; name another robot"
        return None


def _empty(robot: str) -> str:
    return f"the battery of {robot} is empty: it stays where it is until somebody charges it"


_ABOUT = {
    "place": "where to drive",
    "point_m": "where, as [x, y, z] in metres",
    "object": "which thing",
    "robot": "into whose basket",
}
_DOES = {
    MotionKind.GRASP: "take up",
    MotionKind.PLACE_AT: "put things on or in",
    MotionKind.HAND_OVER: "give things to",
    MotionKind.OPEN: "open",
    MotionKind.CLOSE: "close",
    MotionKind.SWITCH_ON: "switch on",
    MotionKind.SWITCH_OFF: "switch off",
}
