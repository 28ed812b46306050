"""A fleet of real processes that messages are sent to, and a mission for it afterwards."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from io import StringIO
from pathlib import Path
from types import TracebackType

import zenoh
from rich.console import Console

from cli.client.fleet_view import FLEET_KEYS, snapshot
from cli.client.health import health
from cli.client.planner_requests import ask_planner, request_name
from cli.client.publish import put_goal
from cli.client.world import put_world
from cli.demo.mission_run import Demo, DemoOptions, running_demo
from cli.errors import TooLate
from cli.views.why import why_page
from cli.why.chain import explain
from keyexpr_schema.errors import ForeignKey, NoReply, Overtaken
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.key import Component
from keyexpr_schema.keyspace import FACT, HISTORY_STATS, KEYSPACE, ROBOT_SPEC
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.history import HistoryStatsQuery
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.world import PERSON_SOURCE, Fact, FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from sim.files.world_payloads import object_payloads, place_payloads, region_payloads
from tests.fuzz.messages import Message, message
from tests.support.polling import until

TOGETHER = 250
"""After so many messages the fleet is given time to take them in."""
KEPT_UP_S = 120.0
SOMEBODY = bytes(range(1, 17))
"""Whose clock a time stamp says that it is from."""
THING, TARGETS = "cup_1", ("hallway", "living_room")


class Sender:
    """A client of the fleet's router that speaks Zenoh and nothing else."""

    def __init__(self, endpoint: str, realm: str) -> None:
        config = zenoh_config("client", connect=(endpoint,), lease_s=10.0, namespace=realm)
        self._session = zenoh.open(config)
        self._tokens: list[zenoh.LivelinessToken] = []
        self.sent = 0
        self.impossible = 0
        """Messages that Zenoh itself does not send."""

    def __enter__(self) -> Sender:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        for token in self._tokens:
            token.undeclare()
        self._session.close()  # type: ignore[no-untyped-call]

    def send(self, one: Message) -> None:
        """Do what a message says; what comes of it is nobody's concern."""
        try:
            self._send(one)
        except (zenoh.ZError, ValueError, UnicodeEncodeError, OverflowError):
            self.impossible += 1
        else:
            self.sent += 1

    def keys(self, pattern: str) -> list[str]:
        """Which keys have a value, readable or not."""
        replies = self._session.get(pattern, timeout=KEPT_UP_S)
        return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]

    def _send(self, one: Message) -> None:
        stamp = self._session.new_timestamp()
        if one.ahead_s is not None:
            seconds = max(0, int(time.time() + one.ahead_s))
            stamp = zenoh.Timestamp(zenoh.NTP64(seconds, 0), SOMEBODY)
        block = zenoh.CongestionControl.BLOCK
        match one.operation:
            case "put":
                self._session.put(
                    one.keyexpr,
                    one.data,
                    encoding=one.encoding or None,
                    timestamp=stamp,
                    congestion_control=block,
                )
            case "delete":
                self._session.delete(one.keyexpr, timestamp=stamp, congestion_control=block)
            case "query":
                self._session.get(
                    one.keyexpr,
                    lambda reply: None,
                    payload=one.data or None,
                    encoding=one.encoding or None,
                    timeout=2.0,
                    congestion_control=block,
                )
            case "token":
                self._tokens.append(self._session.liveliness().declare_token(one.keyexpr))
                while len(self._tokens) > 20:
                    self._tokens.pop(0).undeclare()


class Fuzzed:
    """A fleet that runs, and who sends messages to it."""

    def __init__(self, demo: Demo, sender: Sender) -> None:
        self._demo, self._sender = demo, sender
        self._pids = self._now()

    def _now(self) -> dict[str, int | None]:
        processes = self._demo.processes
        return {name: processes.pid(name) for name in processes.names}

    @property
    def logs(self) -> dict[str, str]:
        """What each process has said."""
        processes = self._demo.processes
        return {
            name: processes.log(name).read_text(encoding="utf-8", errors="replace")
            for name in processes.names
        }

    async def send(self, seed: int, numbers: range) -> None:
        """Send these messages of a run, and wait until planner and store have taken them in.

        Raises:
            ProcessDied: one did; the message names it, and its log.
        """
        await self._demo.processes.guard(self._sent(seed, numbers))

    async def _sent(self, seed: int, numbers: range) -> None:
        for number in numbers:
            await asyncio.to_thread(self._sender.send, message(seed, number))
        await until(self._answers, f"an answer after {seed}/{numbers}", KEPT_UP_S)

    async def _answers(self) -> bool:
        with contextlib.suppress(NoReply):
            await self._demo.session.query(
                HISTORY_STATS, PlannerAddress(), HistoryStatsQuery(), timeout_s=10.0
            )
            return True
        return False

    def assert_all_up(self) -> None:
        """Every process is the one that was started."""
        assert self._now() == self._pids
        assert None not in self._pids.values()

    async def carry_out_a_mission(self) -> None:
        """A person tidies up, says what is so, and wants something; it is done.

        Raises:
            ProcessDied: a process ended meanwhile.
        """
        await self._demo.processes.guard(self._mission())

    async def _mission(self) -> None:
        demo = self._demo
        session, view, world = demo.session, demo.view, demo.mission.world
        robots = [robot.spec.robot for robot in demo.mission.robots]
        ours = {ROBOT_SPEC.build(RobotAddress(robot)) for robot in robots}  # workers would end
        for key in KEYSPACE:
            if key.stored and Component.PERSON in key.writers:
                for keyexpr in await asyncio.to_thread(self._sender.keys, key.pattern()):
                    if keyexpr not in ours:
                        with contextlib.suppress(ForeignKey):  # nobody knows what is there
                            delete = partial(session.delete, key, key.parse(keyexpr), KEPT_UP_S)
                            await _written(delete)
        places, objects = place_payloads(world), object_payloads(world)
        await _written(partial(put_world, session, places, objects, region_payloads(world)))
        for robot in demo.mission.robots:
            where = RobotAddress(robot.spec.robot)
            await _written(partial(session.confirm, ROBOT_SPEC, where, robot.spec))

        for name, truth in view.truths.items():
            if name in world.object_entries and (where := truth.held_by or truth.place):
                await self._say(name, AT, where)
        for name in robots:
            senses = view.senses.get(name)
            if senses is not None and senses.place is not None:
                await self._say(name, AT, senses.place)
                await self._say(name, HOLDING, senses.holding or NOTHING)
        lies = view.truths[THING].place
        target = next(place for place in TARGETS if place != lies)
        goal = await put_goal(
            session, f"Bring the first cup to the {target.replace('_', ' ')}.", None
        )
        await view.until_read((goal.goal,), "the goal", KEPT_UP_S, KEPT_UP_S)
        status = view.goal_status[goal.goal]
        assert status.state is not GoalState.REJECTED, status
        if status.state is not GoalState.REACHED:
            asked = PlanRequest(request=request_name(), goals=(goal.goal,))
            await ask_planner(session, asked, KEPT_UP_S)
        try:
            await view.until(lambda: view.ended((goal.goal,)), KEPT_UP_S, "the goal to end")
        except TooLate as error:
            raise AssertionError(f"{error}:\n{await self._why(goal.goal)}") from None
        assert view.goal_status[goal.goal].state is GoalState.REACHED, view.goal_status[goal.goal]

    async def _why(self, goal: str) -> str:
        """What `robotctl why` says of a goal."""
        view = await snapshot(self._demo.session, *FLEET_KEYS)
        console = Console(record=True, width=200, file=StringIO())
        console.print(why_page(explain(view, goal, await health(self._demo.session))))
        return console.export_text()

    async def _say(self, subject: str, relation: str, value: str) -> None:
        time_s = self._demo.view.clock.time_s if self._demo.view.clock else 0.0
        fact = Fact(
            subject=subject, relation=relation, value=value, source=PERSON_SOURCE, time_s=time_s
        )
        where = FactAddress.of(fact.key)
        await _written(partial(self._demo.session.confirm, FACT, where, fact))


async def _written(write: Callable[[], Awaitable[object]]) -> None:
    """Write it again for as long as somebody whose clock was ahead has the last word there."""

    async def is_written() -> bool:
        with contextlib.suppress(Overtaken):
            await write()
            return True
        return False

    await until(is_written, "the last word", KEPT_UP_S)


@asynccontextmanager
async def fuzzed_fleet(out: Path) -> AsyncIterator[Fuzzed]:
    """Router, recorder, simulated world, planner and two workers, each a process."""
    options = DemoOptions("two-cups", out, backend="kinematic", apart=True)
    async with running_demo(options) as demo:
        with Sender(demo.processes.endpoint, demo.processes.realm) as sender:
            yield Fuzzed(demo, sender)
