"""A model of things that are carried, for the laws of what is believed of them: what is really so,
and a real worker's `SkillContext`, journal and outbox.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from math import inf
from pathlib import Path

from msgspec.structs import replace

from keyexpr_schema.facts import AT, HOLDING, FactKey, Value
from keyexpr_schema.full_disk import FullDisk
from keyexpr_schema.keyspace import FACT
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
    Senses,
)
from keyexpr_schema.payloads.programs import ProgramCall
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.tasks import Order, ReportState
from keyexpr_schema.payloads.world import Fact, FactAddress, Place
from keyexpr_schema.transport.session import Change
from tests.support.carried_words import (
    ANA,
    FIRST_RUN,
    OTHER,
    PLACES,
    ROBOT,
    SPECS,
    THINGS,
    WITH_BASKET,
    Clocks,
    Line,
    Planner,
    Speaker,
    Store,
    Word,
)
from tests.support.household import cup
from workers.orders.fencing import Phase
from workers.orders.journal import FinishedCall, Journal
from workers.orders.outbox import Outbox, make_report
from workers.recovery import (
    interrupted,
    observe_after_crash,
    observe_robot,
    observe_what_is_left,
)
from workers.skill_context import SkillContext
from workers.world_cache import WorldCache

HAND, BASKET = "hand", "basket"
"""Where a thing is that `ROBOT` has."""


class Body:
    """The embodiment of the robot: what is really so."""

    def __init__(self, clocks: Clocks) -> None:
        self.robot, self._clocks = ROBOT, clocks
        self.place = PLACES[0]
        self.where: dict[str, str] = dict.fromkeys(THINGS, PLACES[0])

    def things_at(self, where: str) -> tuple[str, ...]:
        return tuple(thing for thing in THINGS if self.where[thing] == where)

    @property
    def held(self) -> str | None:
        return next(iter(self.things_at(HAND)), None)

    def now_s(self) -> float:
        return self._clocks.fleet_s

    async def senses(self) -> Senses:
        return Senses(
            robot=ROBOT, time_s=self.now_s(), pose_m_rad=(0.0, 0.0, 0.0), place=self.place,
            holding=self.held, basket=self.things_at(BASKET), basket_sensor=True,
        )  # fmt: skip

    async def stop(self) -> None:
        """It moves only where a test says so."""

    async def perform(self, motion: Motion) -> MotionOutcome:
        seen = [(thing, "floor") for thing in self.things_at(self.place)]
        seen += [(thing, ROBOT) for thing in self.things_at(BASKET)]
        found = tuple(
            Detection(object=o, kind="cup", point_m=(0.0, 0.0, 0.0), place=self.place, support=on)
            for o, on in seen
        )
        looked = found if motion.kind is MotionKind.LOOK else ()
        done = MotionState.SUCCEEDED
        return MotionOutcome(state=done, senses=await self.senses(), detections=looked)


class Run:
    """One run of the robot's worker."""

    def __init__(
        self, path: Path, body: Body, store: Store, clocks: Clocks, spec: RobotSpec, number: int
    ) -> None:
        self._body, self._spec = body, spec
        self.incarnation = f"run_{number}"
        self.cache = WorldCache()
        self.cache.specs.update({**SPECS, ROBOT: spec})
        self.cache.places.update((name, Place(place=name, label=name)) for name in PLACES)
        self.cache.objects.update((f"cup_{n}", cup(n)) for n in range(1, len(THINGS) + 1))
        self.journal = Journal(path / "hsr.journal", wall_s=clocks.now_s).__enter__()
        self.line = Line(store, clocks, number)
        disk = FullDisk(path, "it", "it waits", lambda _: None)
        self.outbox = Outbox(self.line, self.journal, disk)  # type: ignore[arg-type]
        self._sending = asyncio.create_task(self.outbox.run())
        self.ctx: SkillContext | None = None
        self.order: Order | None = None
        self._said: set[Fact] = set()

    def hear(self, fact: Fact) -> None:
        self.cache.apply(Change(FACT, FactAddress.of(fact.key), fact, ""))

    def context(self) -> SkillContext:
        return SkillContext(self._spec, self._body, self.cache, self.journal.seen)

    async def recover(self) -> None:
        """What `Worker` does before it takes orders."""
        ctx = self.context()
        await observe_robot(ctx)
        await self.outbox.add(*ctx.observed)
        for attempt in self.journal.ledger.in_phase(Phase.STARTED):
            self.ctx = self.context()
            self.order = attempt.order
            await observe_after_crash(self.ctx, attempt.order)
            self.end(ReportState.INTERRUPTED)

    def begin(self, number: int, thing: str) -> None:
        args = {"robot": ROBOT, "object": thing}
        self.order = Order(
            robot=ROBOT, plan="p", revision=1, task=f"t{number}", attempt=1, epoch=1,
            skill="pick", args=args, deadline_s=60.0,
        )  # fmt: skip
        self.ctx, self._said = self.context(), set()
        self.journal.started(self.order, make_report(self.order, "i", ReportState.STARTED))
        self.outbox.wake()

    def called(self) -> None:
        """A call of a program has ended: what it has brought is said at once."""
        assert self.ctx is not None and self.order is not None
        number = len(self.journal.calls(self.order)) + 1
        facts = tuple(fact for fact in self.ctx.observed if fact not in self._said)
        self._said.update(facts)
        call = ProgramCall(number=number, name="pick")
        self.journal.called(self.order, FinishedCall(call=call, facts=facts))
        self.outbox.wake()

    def end(self, state: ReportState) -> None:
        """The attempt has ended, with all that it has observed."""
        assert self.ctx is not None and self.order is not None
        report = make_report(self.order, self.incarnation, state)
        if state is ReportState.INTERRUPTED:
            report = interrupted(report, "it was interrupted", self.ctx)
        else:
            now_s = self._body.now_s()
            report = replace(report, facts=self.ctx.observed, ended_s=now_s)
        self.journal.ended(self.order, report)
        self.outbox.wake()
        self.ctx = self.order = None

    async def left(self) -> None:
        """What an attempt that did not succeed does at its end."""
        assert self.ctx is not None and self.order is not None
        await observe_what_is_left(self.ctx, self.order)

    async def crashed(self) -> None:
        """What an attempt does that a stop has interrupted."""
        assert self.ctx is not None and self.order is not None
        await observe_after_crash(self.ctx, self.order)

    async def close(self) -> None:
        """The process is gone."""
        self._sending.cancel()
        await asyncio.gather(self._sending, return_exceptions=True)
        self.journal.__exit__()


class Carried:
    """Everybody there, and what is really so."""

    def __init__(
        self, folder: Path, clocks: Clocks, ahead_s: tuple[float, float], basket: bool
    ) -> None:
        self._clocks, self._folder = clocks, folder
        self.store, self.body = Store(clocks), Body(clocks)
        self.spec = WITH_BASKET if basket else SPECS[ROBOT]
        self.planner = Planner(self.store, clocks, self.spec)
        self.ana, self.other = (
            Speaker(name, number, ahead)
            for name, number, ahead in zip((ANA, OTHER), (1, 2), ahead_s, strict=True)
        )
        self.met: Counter[str] = Counter()
        self.log: list[str] = []
        self.moved_s = dict.fromkeys(THINGS, 0.0)
        """When each thing was moved last."""
        self.heard: list[tuple[Fact, float]] = []
        """What the robot has heard, and when."""
        self._flying: list[tuple[Fact, Speaker, float]] = []
        self._runs, self._attempts = 0, 0
        self.link = True
        self.run: Run | None = None
        self.store.listeners.append(self._passes)
        for thing in THINGS:
            self.says(self.ana, AT, thing, PLACES[0])

    # --- what is so ------------------------------------------------------------------------------

    def moves(self, thing: str, where: str) -> None:
        self.body.where[thing] = where
        self.moved_s[thing] = self._clocks.now_s()

    # --- words -----------------------------------------------------------------------------------

    def _hears(self, fact: Fact) -> None:
        assert self.run is not None
        self.run.hear(fact)
        self.heard.append((fact, self._clocks.now_s()))

    def _passes(self, fact: Fact) -> None:
        if self.run is not None and self.link:
            self._hears(fact)

    def says(self, who: Speaker, relation: str, subject: str, value: Value, how: str = "") -> None:
        """Somebody says something; `how`: it is held back, or flies: robots hear it before the
        store does."""
        fact = Fact(
            relation=relation, subject=subject, value=value, source=who.name,
            time_s=self._clocks.fleet_s + who.ahead_s,
        )  # fmt: skip
        said_s = self._clocks.now_s()
        if how == "held back" or who.waiting:
            who.waiting.append((fact, said_s))
        elif how == "flies":
            self._passes(fact)
            self._flying.append((fact, who, said_s))
        else:
            self._arrives(fact, who, said_s)

    def _arrives(self, fact: Fact, who: Speaker, said_s: float | None) -> None:
        taken = self.store.put(FACT, FactAddress.of(fact.key), fact, who.number, said_s)
        self.met["overtaken"] += not taken

    def lands(self) -> None:
        """What is on its way reaches the store, which knows nothing of how long it was."""
        for fact, who, said_s in self._flying:
            self._arrives(fact, who, None)
            self.store.words[-1] = Word(fact, said_s, self.store.words[-1].came_s)
        self._flying.clear()

    def tells(self, who: Speaker) -> None:
        """The first word that was held back reaches the store."""
        if who.waiting:
            fact, said_s = who.waiting.popleft()
            self._arrives(fact, who, said_s)

    def connect(self, link: bool) -> None:
        """The robot's link breaks, or is back: then it hears what it has missed."""
        if link and not self.link and self.run is not None:
            known = self.run.cache.facts
            for fact in self.store.facts():
                if known.get(fact.key) != fact:
                    self._hears(fact)
        self.link = link

    async def send(self, most: int = 1000) -> None:
        """The robot's words reach the store, the oldest first."""
        for _ in range(most):
            if self.run is None or not self.link or self.run.journal.unsent() is None:
                return
            await self.run.line.let_one()

    # --- the worker ------------------------------------------------------------------------------

    async def start(self, sends: int = 1000) -> None:
        """A worker is started: of what its last run has had to say so much is sent before it
        looks."""
        assert self.run is None
        self._runs += 1
        self.connect(True)
        number = FIRST_RUN + self._runs
        self.run = Run(self._folder, self.body, self.store, self._clocks, self.spec, number)
        for fact in self.store.facts():
            self._hears(fact)
        await self.send(sends)
        seen = self.run.journal.seen
        waits = (fact for fact in seen.all_last() if seen.waits(fact.key) and fact.value == ROBOT)
        self.met["has still to say what is so no more"] += any(
            self.really(fact.subject) != ROBOT for fact in waits
        )
        await self.run.recover()

    async def stop(self, *, in_peace: bool) -> None:
        """The worker ends; in peace it reports first what it was at, as it knows it."""
        assert self.run is not None
        if in_peace and self.run.ctx is not None:
            self.run.end(ReportState.INTERRUPTED)
        await self.run.close()
        self.run = None

    def begin(self, thing: str) -> None:
        assert self.run is not None
        self._attempts += 1
        self.run.begin(self._attempts, thing)

    async def settle(self) -> None:
        """All that was said is heard by everybody."""
        self.lands()
        self.connect(True)
        while self.ana.waiting or self.other.waiting:
            self.tells(self.ana)
            self.tells(self.other)
        await self.send()
        self.planner.hear()
        while self.planner.wanted:
            self.planner.publish()
            self.planner.hear()

    # --- the law ---------------------------------------------------------------------------------

    def known(self, thing: str) -> bool:
        """Whether somebody has said where a thing is, and nothing has moved it since; and the robot
        has not heard, before this came to the store, of what it was then to find wrong."""
        key = FactKey(AT, thing)
        for fact, said_s, came_s in self.store.words:
            if fact.key == key and fact.value is not None and said_s >= self.moved_s[thing]:
                heard = (
                    other
                    for other, heard_s in self.heard
                    if other.key == key and other != fact and said_s < heard_s < came_s
                )
                if next(heard, None) is not None:
                    self.met["denied meanwhile"] += 1
                elif self.planner.let_go_of(fact, said_s):
                    self.met["let go of meanwhile"] += 1
                else:
                    return True
        return False

    def looked(self) -> bool:
        """Whether the robot has said what its hand holds since anything was moved, and, where it
        may be in its basket, since it has heard what others say to be with it."""
        hand, since_s = FactKey(HOLDING, ROBOT), max(self.moved_s.values())
        own = [word for word in self.store.words if word.fact.source == ROBOT]
        if self.spec is WITH_BASKET:
            for fact in {word.fact for word in self.store.words if word.fact.source != ROBOT}:
                if ROBOT in (fact.value, fact.subject):
                    heard = (heard_s for other, heard_s in self.heard if other == fact)
                    since_s = max(since_s, next(heard, inf))
        return any(word.fact.key == hand and word.said_s > since_s for word in own)

    def really(self, thing: str) -> str:
        """The value of `at(thing)` that is true."""
        where = self.body.where[thing]
        return ROBOT if where in (HAND, BASKET) else where
