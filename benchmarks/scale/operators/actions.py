"""What people do to a fleet while it works, by chance, and how all that they hold is ended."""

from __future__ import annotations

import asyncio
import random
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import suppress

from benchmarks.scale.keys_run import CONFIRM_S
from benchmarks.scale.soak import Soak
from cli.client.closures import end_closures, put_closures
from cli.client.goal_changes import check_failed, goals_named, set_urgency, want_again
from cli.client.holds import end_holds, put_holds
from cli.client.publish import fleet_time_s, put_fact
from cli.client.stops import give_stop, lift_stops
from cli.client.unregistering import unregister
from cli.errors import CliError
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import (
    CONTROL_REQUEST,
    GOAL_SPEC,
    OBJECT,
    PLAN_REQUEST,
    REPLAN_REQUEST,
    ROBOT_SPEC,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalAddress, GoalState
from keyexpr_schema.payloads.holds import HoldKind
from keyexpr_schema.payloads.plans import ENDED_PLANS
from keyexpr_schema.payloads.requests import (
    Control,
    ControlRequest,
    PlanRequest,
    ReplanRequest,
    RequestAddress,
)
from keyexpr_schema.payloads.robots import FULL, RobotAddress
from keyexpr_schema.payloads.tasks import ENDED_TASKS
from keyexpr_schema.payloads.world import ObjectAddress
from sim.files.world_payloads import object_payloads

WHO = "benchmark"
LONGEST_S, BETWEEN_S = 0.4, 0.1
"""How long something is held, and people wait before they do the next thing, wall [s]."""
REST_S = 3.0
"""How long is waited for a robot to rest that is unregistered, wall [s]."""
LOW = (12.0, 30.0)
"""How full a battery is that is low [%]: there is a charger in the next room."""
EMPTY = 0.02
"""How full one is that will be empty before its robot has moved a foot [%]."""

Action = Callable[[str, list[str]], Awaitable[None]]


class Operators:
    """People who do things by chance; `end` brings all that they hold to an end.

    `deleted` are goals; `said` what they have said of things that need not be so: where things are,
    by thing, in this mission.
    """

    def __init__(self, soak: Soak, seed: int) -> None:
        self._soak, self._session, self._news = soak, soak.operator, soak.news
        self._rnd = random.Random(seed)
        self._specs = {robot.spec.robot: robot.spec for robot in soak.made.mission.robots}
        self._robots = list(self._specs)
        world = soak.made.mission.world
        self._rooms = list(world.place_entries)
        self._doors = list(world.doors)
        self._cups = {o.object: o for o in object_payloads(world) if o.movable}
        self.did: Counter[str] = Counter()
        self.deleted: set[str] = set()
        self.said: defaultdict[str, set[str]] = defaultdict(set)
        self.exchanged: set[str] = set()
        """Robots whose batteries somebody has made low, and that have not been full since."""
        self.told: set[str] = set()
        self.lost: set[str] = set()
        """Things that were unknown for a while in this mission."""
        self._emptied: set[str] = set()
        self._requests = 0
        often = (self._pause, self._drain, self._stop, self._close, self._wrong_fact)
        self._actions: tuple[Action, ...] = (
            *often, *often, self._cancel, self._delete, self._retry, self._task_done, self._plan,
            self._replan, self._urgency, self._unregister, self._lose_object, self._low_battery,
            self._low_battery, self._empty_battery,
        )  # fmt: skip

    async def disturb(self, mission: str, goals: list[str]) -> None:
        """One thing after the other, until cancelled."""
        while True:
            await asyncio.sleep(self._rnd.uniform(0.0, BETWEEN_S))
            action = self._rnd.choice(self._actions)
            # Refused, as a plan that has ended meanwhile; or a router that is being killed.
            with suppress(CliError, SchemaError):
                await action(mission, goals)
                self.did[action.__name__.strip("_").replace("_", " ")] += 1

    async def end(self, empty: Iterable[str]) -> None:
        """Nothing is held any more, everybody is there, the `empty` have full batteries."""
        await lift_stops(self._session, (), WHO)
        for kind in HoldKind:
            await end_holds(self._session, kind)
            await end_holds(self._session, kind, robots=self._robots)
        await end_closures(self._session, ())
        here = {address.robot for address in await self._session.list(ROBOT_SPEC)}
        for robot in self._robots:
            if robot not in here:
                await self._register(robot)
        things = {address.object for address in await self._session.list(OBJECT)}
        for cup in self._cups:
            if cup not in things:
                await self._put_object(cup)
        for robot in {*self._emptied, *empty}:
            await self._exchange(robot, FULL)

    async def look(self, places: dict[str, str | None], held: dict[str, str]) -> None:
        """Somebody looks where the things are of which something was said, and says so. Those that
        are in a hand then stay there until somebody wants them: `told`."""
        self.told.intersection_update(held)
        for cup in [*self.said]:
            if cup in held:
                self.told.add(cup)
                await put_fact(self._session, "holding", held[cup], cup, by=WHO)
            if (where := held.get(cup, places.get(cup))) is not None:
                await put_fact(self._session, "at", cup, where, by=WHO)
        self.said.clear()
        self.lost.clear()

    async def delete(self, goal: str) -> None:
        """Want a goal no more."""
        self.deleted.add(goal)
        await self._session.delete(GOAL_SPEC, GoalAddress(goal))

    async def want_again(self, goal: str) -> None:
        """Try a goal again that has failed."""
        await self._want_again(goal)
        self.did["retry"] += 1

    async def ask(self, plan: str, goals: Sequence[str]) -> None:
        """Ask for a plan of this name."""
        name = self._request()
        request = PlanRequest(request=name, plan=plan, goals=tuple(goals), by=WHO)
        await self._session.confirm(PLAN_REQUEST, RequestAddress(name), request, CONFIRM_S)

    async def _pause(self, mission: str, goals: list[str]) -> None:
        robots = self._some(self._robots)
        now = self._rnd.random() < 0.5
        await put_holds(self._session, HoldKind.PAUSE, robots, (), WHO, "", interrupt=now)
        await self._while_held()
        await end_holds(self._session, HoldKind.PAUSE, robots=robots)

    async def _drain(self, mission: str, goals: list[str]) -> None:
        robots = self._some(self._robots)[:2]
        await put_holds(self._session, HoldKind.DRAIN, robots, (), WHO, "")
        await self._while_held()
        await end_holds(self._session, HoldKind.DRAIN, robots=robots)

    async def _stop(self, mission: str, goals: list[str]) -> None:
        robots = self._some(self._robots)
        await give_stop(self._session, robots, WHO, "", 0.0, lambda _: None)
        await self._while_held()
        await lift_stops(self._session, robots, WHO)

    async def _close(self, mission: str, goals: list[str]) -> None:
        names = self._some(self._rooms + self._doors)[:1]
        one = self._rnd.random() < 0.3
        await put_closures(self._session, names, (), (), WHO, "", one_at_a_time=one)
        await self._while_held()
        await end_closures(self._session, names)

    async def _wrong_fact(self, mission: str, goals: list[str]) -> None:
        cup, room = self._rnd.choice(list(self._cups)), self._rnd.choice(self._rooms)
        self.said[cup].add(room)
        await put_fact(self._session, "at", cup, room, by=WHO)

    async def _cancel(self, mission: str, goals: list[str]) -> None:
        plan = self._open_plan(mission)
        await self._control(Control.CANCEL, plan)

    async def _replan(self, mission: str, goals: list[str]) -> None:
        plan, name = self._open_plan(mission), self._request()
        request = ReplanRequest(request=name, plan=plan, reason="somebody wants it", by=WHO)
        await self._session.confirm(REPLAN_REQUEST, RequestAddress(name), request, CONFIRM_S)

    async def _plan(self, mission: str, goals: list[str]) -> None:
        """For goals that a plan which was cancelled has left."""
        self._requests += 1
        left = [g for g in goals if self._news.goals.get(g) is GoalState.WAITING]
        if not left:
            raise CliError("nothing waits")
        await self.ask(f"{mission}-people-{self._requests}", left)

    async def _delete(self, mission: str, goals: list[str]) -> None:
        goal = self._rnd.choice(goals)
        if goal not in self.deleted:
            await self.delete(goal)

    async def _retry(self, mission: str, goals: list[str]) -> None:
        failed = [g for g in goals if self._news.goals.get(g) is GoalState.FAILED]
        await self._want_again(self._rnd.choice(failed or goals))

    async def _want_again(self, goal: str) -> None:
        specs, status = await goals_named(self._session, [goal])
        check_failed([goal], status)
        await want_again(self._session, specs, status, WHO)

    async def _urgency(self, mission: str, goals: list[str]) -> None:
        open_ = [g for g in goals if self._news.goals.get(g) not in ENDED_GOALS]
        specs, _ = await goals_named(self._session, [self._rnd.choice(open_ or goals)])
        due_s = await fleet_time_s(self._session) + self._rnd.uniform(0.0, 300.0)
        await set_urgency(self._session, specs, WHO, self._rnd.randrange(5), due_s, False)

    async def _task_done(self, mission: str, goals: list[str]) -> None:
        plan = self._open_plan(mission)
        records = (await self._session.list(TASK_RECORD, plan=plan)).values()
        left = [record for record in records if record.state not in ENDED_TASKS]
        if not left:
            raise CliError("nothing is left to be done")
        record = self._rnd.choice(left)
        for cup in record.args.values():
            if cup in self._cups:
                self.said[cup].update(self._rooms)
        await self._control(Control.TASK_DONE, plan, record.task)

    async def _unregister(self, mission: str, goals: list[str]) -> None:
        robot = self._rnd.choice(self._robots)
        force = self._rnd.random() < 0.2
        try:
            gone = await unregister(self._session, robot, WHO, "", REST_S, force)
            for cup in gone.carried:
                self.said[cup].add("")
        finally:
            with suppress(SchemaError):
                await end_holds(self._session, HoldKind.DRAIN, robots=[robot])
        await self._while_held()
        await self._register(robot)

    async def _register(self, robot: str) -> None:
        spec = self._specs[robot]
        await self._session.confirm(ROBOT_SPEC, RobotAddress(robot), spec, CONFIRM_S)

    async def _lose_object(self, mission: str, goals: list[str]) -> None:
        cup = self._rnd.choice(list(self._cups))
        self.lost.add(cup)
        await self._session.delete(OBJECT, ObjectAddress(cup))
        await self._while_held()
        await self._put_object(cup)

    async def _put_object(self, cup: str) -> None:
        await self._session.confirm(OBJECT, ObjectAddress(cup), self._cups[cup], CONFIRM_S)

    async def _low_battery(self, mission: str, goals: list[str]) -> None:
        await self._exchange(self._rnd.choice(self._robots), self._rnd.uniform(*LOW))

    async def _empty_battery(self, mission: str, goals: list[str]) -> None:
        robot = self._rnd.choice(self._robots)
        self._emptied.add(robot)
        await self._exchange(robot, EMPTY)
        await self._while_held()
        await self._exchange(robot, FULL)

    async def _exchange(self, robot: str, percent: float) -> None:
        """Exchange a robot's battery for one that is so full."""
        if percent < FULL:
            self.exchanged.add(robot)
        await self._soak.made.sim.tell(f"{robot} {percent}")
        if percent >= FULL:
            self._emptied.discard(robot)

    async def _control(self, control: Control, plan: str, task: str | None = None) -> None:
        name = self._request()
        request = ControlRequest(request=name, plan=plan, control=control, task=task, by=WHO)
        await self._session.confirm(CONTROL_REQUEST, RequestAddress(name), request, CONFIRM_S)

    def _request(self) -> str:
        self._requests += 1
        return f"ask-{self._requests}"

    def _open_plan(self, mission: str) -> str:
        plans = self._news.plans.items()
        named = [p for p, s in plans if p.partition("-")[0] == mission and s not in ENDED_PLANS]
        if not named:
            raise CliError("no plan goes on")
        return self._rnd.choice(named)

    def _some(self, names: list[str]) -> list[str]:
        return self._rnd.sample(names, self._rnd.randint(1, len(names)))

    async def _while_held(self) -> None:
        await asyncio.sleep(self._rnd.uniform(0.0, LONGEST_S))
