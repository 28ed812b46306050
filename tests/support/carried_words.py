"""How words of the world travel in a model of a fleet: the store's law of acceptance, the planner's
core, and clocks that nobody reads but the model. No Zenoh: they come when the model is told so.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import Publish
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from keyexpr_schema.decoding import decode
from keyexpr_schema.errors import Overtaken
from keyexpr_schema.facts import Value
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Report
from keyexpr_schema.payloads.world import Fact, FactAddress, Place
from keyexpr_schema.transport.stamps import stamp_of
from keyexpr_schema.transport.store.receipts import successor
from keyexpr_schema.transport.store.storage import Write
from tests.support.household import SKILLS, cup, manipulator

ROBOT, OTHER, ANA = "hsr", "hsr_2", "ana"
THINGS, PLACES = ("cup_1", "cup_2"), ("kitchen", "hallway")
SPECS = {name: manipulator(name) for name in (ROBOT, OTHER)}
WITH_BASKET = replace(SPECS[ROBOT], capabilities={**SPECS[ROBOT].capabilities, "basket": 2.0})
PLANNER, FIRST_RUN = 3, 10
"""Numbers of sessions: of the planner, and of the worker's first run."""
BEGUN_S = 1_000_000.0


class Clocks:
    """What the hosts' clock shows that nobody sets, which rises whenever it is read, and the
    fleet's."""

    def __init__(self) -> None:
        self._us = int(BEGUN_S * 1e6)
        self.fleet_s = 100.0

    def now_s(self) -> float:
        self._us += 1
        return self._us / 1e6

    def pass_by(self, seconds: float) -> None:
        self._us += round(seconds * 1e6)
        self.fleet_s += seconds


class Word(NamedTuple):
    """Something that was said, when, and when it came to the store."""

    fact: Fact
    said_s: float
    came_s: float


class Store:
    """The newest write of each key, by the store's own law, in the order in which they changed."""

    def __init__(self, clocks: Clocks) -> None:
        self._clocks, self._ticks = clocks, 0
        self._latest: dict[str, tuple[int, Write]] = {}
        self._changes = 0
        self.listeners: list[Callable[[Fact], None]] = []
        self.words: list[Word] = []
        """What robots and people have said."""

    def put(
        self, key: Key[Any, Any], address: Address, payload: Any, by: int, said_s: float | None
    ) -> bool:
        """Whether it took the place of what was there; `said_s`: when it was said, if its writer
        tells."""
        keyexpr = f"home/{key.build(address)}"
        self._ticks += 1
        now_s = self._clocks.now_s()
        late_s = 0.0 if said_s is None else max(0.0, now_s - said_s)
        write = Write(
            keyexpr, stamp_of(self._ticks, by), False, "", key.encode(payload),
            round(late_s * 1e6), round(now_s * 1e6),
        )  # fmt: skip
        if key is FACT and by != PLANNER:
            said_s = now_s if said_s is None else said_s
            self.words.append(Word(payload, said_s, now_s))
        _, known = self._latest.pop(keyexpr, (0, None))
        taken = successor(write, known)
        self._changes += 1
        if taken is None:
            assert known is not None
            self._latest[keyexpr] = self._changes, known
            return False
        self._latest[keyexpr] = self._changes, taken
        if key is FACT:
            for hears in self.listeners:
                hears(payload)
        return True

    def fact(self, address: FactAddress) -> Fact | None:
        found = self._latest.get(f"home/{FACT.build(address)}")
        return None if found is None else decode(found[1].data, Fact)

    def facts(self) -> list[Fact]:
        stored = (w for _, w in self._latest.values() if "/world/facts/" in w.keyexpr)
        return [decode(write.data, Fact) for write in stored]

    def since(self, position: int) -> tuple[list[Write], int]:
        changes = sorted(self._latest.values(), key=lambda each: each[0])
        return [write for number, write in changes if number > position], self._changes


class Line:
    """What an outbox uses of a session: one write after the other reaches the store, when let."""

    def __init__(self, store: Store, clocks: Clocks, by: int) -> None:
        self._store, self._clocks, self._by = store, clocks, by
        self._may, self._has = asyncio.Semaphore(0), asyncio.Semaphore(0)

    async def let_one(self) -> None:
        """One write, that waits, reaches the store."""
        self._may.release()
        await self._has.acquire()

    async def confirm(
        self, key: Any, address: Any, payload: Any, within_s: float = 0.0, *, age_s: float = 0.0
    ) -> None:
        said_s = self._clocks.now_s() - age_s
        await self._may.acquire()
        taken = self._store.put(key, address, payload, self._by, said_s)
        self._has.release()
        if not taken:
            raise Overtaken("somebody has said something of it since")

    async def get(self, key: Any, address: FactAddress) -> Fact | None:
        return self._store.fact(address)


@dataclass
class Speaker:
    """Somebody whose words reach the store in their order, as of when they were said."""

    name: str
    number: int
    ahead_s: float
    """By so much is this one's clock ahead of the fleet's."""
    waiting: deque[tuple[Fact, float]] = field(default_factory=deque)


class Planner:
    """The planner's core, which hears of the store in the order of its receipts."""

    def __init__(self, store: Store, clocks: Clocks, spec: RobotSpec) -> None:
        self._store, self._clocks, self._position = store, clocks, 0
        self.state = State()
        self.wanted: dict[FactAddress, tuple[Fact, float]] = {}
        """What it has concluded and is to publish, and since when."""
        self.log: list[tuple[Fact, float]] = []
        """What it has heard and concluded, and when."""
        self._take(events.PlannerStarted, epoch=1, incarnation="i", logic=LOGIC, skills=SKILLS)
        for place in PLACES:
            self._take(events.PlacePut, place=Place(place=place, label=place))
        for number in range(1, len(THINGS) + 1):
            self._take(events.ObjectPut, object=cup(number))
        for each in {**SPECS, ROBOT: spec}.values():
            self._take(events.RobotRegistered, spec=each)
            self._take(events.WorkerConnected, robot=each.robot, incarnation="i")

    def _take(self, kind: Any, **fields: Any) -> None:
        at = {"time_s": self._clocks.fleet_s, "wall_time_s": self._clocks.fleet_s}
        self.state, effects = step(self.state, kind(**at, **fields))
        for effect in effects:
            if isinstance(effect, Publish) and effect.key is FACT:
                self.wanted[effect.address] = effect.payload, self._clocks.now_s()
                self.log.append((effect.payload, self._clocks.now_s()))

    def hear(self) -> None:
        """Take in what has changed in the store."""
        writes, self._position = self._store.since(self._position)
        for write in writes:
            if "/world/facts/" in write.keyexpr:
                fact = decode(write.data, Fact)
                self._take(events.FactPut, fact=fact, received=write.received)
                self.log.append((fact, self._clocks.now_s()))
            else:
                report = decode(write.data, Report)
                self._take(events.ReportReceived, report=report, received=write.received)

    def let_go_of(self, word: Fact, said_s: float) -> bool:
        """Whether it has concluded that nobody knows of a thing, before it has heard a word of it
        that was said earlier."""
        for fact, when_s in self.log:
            if fact == word:
                return False
            by_planner = fact.value is None and fact.source != ROBOT
            if by_planner and fact.key == word.key and said_s < when_s:
                return True
        return False

    def publish(self) -> None:
        """The oldest of what is to be published reaches the store."""
        address = next(iter(self.wanted))
        fact, since_s = self.wanted.pop(address)
        self._store.put(FACT, address, fact, PLANNER, since_s)

    def believes(self, relation: str, subject: str) -> Value:
        known = self.state.fact(relation, subject)
        return None if known is None else known.value
