"""What people do to a fleet while it works, by chance: hold it, close rooms, tell it what is wrong.

`python -m benchmarks.scale.operator_actions [--missions 50] [--seed 0]`. The fleet of
`benchmarks.scale.soak`, with pauses, drains, stops, closed rooms, wrong facts, cancelled plans and
deleted goals at any moment, and one of its processes killed now and then. After each mission all
that holds is ended; then every goal has to be reached, deleted, or failed with a reason, no task
may have been done twice, and in the end no robot may be left with an order.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from benchmarks.scale.keys_run import CONFIRM_S
from benchmarks.scale.soak import MISSION_S, Soak, soaking
from cli.client.closures import end_closures, put_closures
from cli.client.holds import end_holds, put_holds
from cli.client.publish import put_fact
from cli.client.stops import give_stop, lift_stops
from cli.errors import Unknown
from keyexpr_schema.keyspace import CONTROL_REQUEST, GOAL_SPEC, ORDER, PLAN_REQUEST, REPORT
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalAddress, GoalState
from keyexpr_schema.payloads.holds import HoldKind
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanState
from keyexpr_schema.payloads.requests import (
    Control,
    ControlRequest,
    PlanRequest,
    RequestAddress,
)
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import Session

WHO = "benchmark"
ROBOTS = 8
LONGEST_S, BETWEEN_S = 0.4, 0.1
"""How long something is held, and people wait before they do the next thing, wall [s]."""
DISTURBED_S = 3.0
"""For how long a mission is disturbed."""


class Operators:
    """People who do things by chance; `ended` brings all that they hold to an end."""

    def __init__(self, session: Session, rooms: list[str], robots: list[str], seed: int) -> None:
        self._session, self._rooms, self._robots = session, rooms, robots
        self._rnd = random.Random(seed)
        self.did: Counter[str] = Counter()
        self.deleted: set[str] = set()
        self._requests = 0

    async def disturb(self, plan: str, goals: list[str]) -> None:
        """One thing after the other, until cancelled."""
        actions: tuple[Callable[[str, list[str]], Awaitable[None]], ...] = (
            self._pause, self._pause, self._drain, self._stop, self._close, self._close,
            self._pause, self._drain, self._stop, self._close, self._wrong_fact,
            self._wrong_fact, self._cancel, self._delete,
        )  # fmt: skip
        while True:
            await asyncio.sleep(self._rnd.uniform(0.0, BETWEEN_S))
            action = self._rnd.choice(actions)
            with suppress(Unknown):  # the plan has ended meanwhile
                await action(plan, goals)
                self.did[action.__name__.strip("_")] += 1

    async def end(self) -> None:
        """Nothing is held any more."""
        await lift_stops(self._session, (), WHO)
        await end_holds(self._session, HoldKind.PAUSE)
        await end_holds(self._session, HoldKind.PAUSE, robots=self._robots)
        await end_holds(self._session, HoldKind.DRAIN, robots=self._robots)
        await end_closures(self._session, ())

    async def _pause(self, plan: str, goals: list[str]) -> None:
        robots = self._some(self._robots)
        now = self._rnd.random() < 0.5
        await put_holds(self._session, HoldKind.PAUSE, robots, (), WHO, "", interrupt=now)
        await self._while_held()
        await end_holds(self._session, HoldKind.PAUSE, robots=robots)

    async def _drain(self, plan: str, goals: list[str]) -> None:
        robots = self._some(self._robots)[:2]
        await put_holds(self._session, HoldKind.DRAIN, robots, (), WHO, "")
        await self._while_held()
        await end_holds(self._session, HoldKind.DRAIN, robots=robots)

    async def _stop(self, plan: str, goals: list[str]) -> None:
        robots = self._some(self._robots)
        await give_stop(self._session, robots, WHO, "", 0.0, lambda _: None)
        await self._while_held()
        await lift_stops(self._session, robots, WHO)

    async def _close(self, plan: str, goals: list[str]) -> None:
        rooms = self._some(self._rooms)[:1]
        one = self._rnd.random() < 0.3
        await put_closures(self._session, rooms, (), (), WHO, "", one_at_a_time=one)
        await self._while_held()
        await end_closures(self._session, rooms)

    async def _wrong_fact(self, plan: str, goals: list[str]) -> None:
        cup = f"cup_{self._rnd.randrange(len(goals))}"
        await put_fact(self._session, "at", cup, self._rnd.choice(self._rooms), by=WHO)

    async def _cancel(self, plan: str, goals: list[str]) -> None:
        self._requests += 1
        name = f"cancel-{plan}-{self._requests}"
        request = ControlRequest(request=name, plan=plan, control=Control.CANCEL, by=WHO)
        await self._session.confirm(CONTROL_REQUEST, RequestAddress(name), request, CONFIRM_S)

    async def _delete(self, plan: str, goals: list[str]) -> None:
        goal = self._rnd.choice(goals)
        if goal not in self.deleted:
            self.deleted.add(goal)
            await self._session.delete(GOAL_SPEC, GoalAddress(goal))

    def _some(self, names: list[str]) -> list[str]:
        return self._rnd.sample(names, self._rnd.randint(1, len(names)))

    async def _while_held(self) -> None:
        await asyncio.sleep(self._rnd.uniform(0.0, LONGEST_S))


class Witness:
    """Counts the attempts of each task that succeeded."""

    def __init__(self) -> None:
        self.succeeded: defaultdict[tuple[str, str], set[int]] = defaultdict(set)

    async def follow(self, session: Session) -> None:
        """Watch for ever."""
        async with session.watch(REPORT) as watch:
            async for change in watch:
                report = change.value
                if report is not None and report.state is ReportState.SUCCEEDED:
                    self.succeeded[report.plan, report.task].add(report.attempt)

    @property
    def twice(self) -> list[tuple[str, str]]:
        """Tasks that were done twice."""
        return [task for task, attempts in self.succeeded.items() if len(attempts) > 1]


async def live(folder: Path, missions: int, kill_every: int, seed: int) -> None:
    """So many missions, each disturbed and then brought to its end; says what became of them."""
    async with soaking(folder, ROBOTS) as soak:
        session = soak.operator
        rooms = [f"room_{number}" for number in range(soak.cups)]
        operators = Operators(session, rooms, list(soak.robots), seed)
        witness = Witness()
        following = asyncio.create_task(witness.follow(session))
        ends: Counter[str] = Counter()
        reasons: Counter[str] = Counter()
        for number in range(missions):
            if number and number % kill_every == 0:
                operators.did[f"kill {(await soak.restart())[0]}"] += 1
            began_s = time.perf_counter()
            goals = await soak.put_goals(number)
            plan = f"m{number}"
            await _ask(session, plan, goals)
            people = asyncio.create_task(operators.disturb(plan, goals))
            ended = partial(_all_ended, soak, goals)
            await soak.news.until(ended, DISTURBED_S)
            people.cancel()
            await asyncio.gather(people, return_exceptions=True)
            await operators.end()
            await _until_over(soak, plan, [g for g in goals if g not in operators.deleted])
            for goal in goals:
                state = soak.news.goals[goal]
                ends["deleted" if goal in operators.deleted else state.value] += 1
                if goal not in operators.deleted and state is GoalState.FAILED:
                    reason = soak.news.reasons[goal]
                    assert reason, f"{goal} failed without a reason"
                    reasons[reason] += 1
            assert not witness.twice, f"done twice: {witness.twice}"
            print(f"mission {number}: {time.perf_counter() - began_s:.1f} s", flush=True)
        left = [
            order
            for order in (await session.list(ORDER)).values()
            if soak.news.plans.get(order.plan) not in ENDED_PLANS
        ]
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)
    print(f"{missions} missions: {dict(ends)}; {dict(operators.did)}")
    print(f"done twice: {len(witness.twice)}; tasks done: {len(witness.succeeded)}")
    print(f"orders left: {len(left)}")
    for reason, count in reasons.most_common(10):
        print(f"{count} x {reason}")


def _all_ended(soak: Soak, goals: list[str]) -> bool:
    return all(soak.news.goals.get(goal) in ENDED_GOALS for goal in goals)


async def _ask(session: Session, plan: str, goals: list[str]) -> None:
    request = PlanRequest(request=f"ask-{plan}", plan=plan, goals=tuple(goals))
    address = RequestAddress(request.request)
    await session.confirm(PLAN_REQUEST, address, request, CONFIRM_S)


async def _until_over(soak: Soak, plan: str, goals: list[str]) -> None:
    """Until the goals have ended; asks for another plan where one was cancelled or refused."""
    news, again = soak.news, 0
    dead = {PlanState.CANCELLED, PlanState.REJECTED, PlanState.FAILED, PlanState.SUCCEEDED}

    def open_goals() -> list[str]:
        return [goal for goal in goals if news.goals.get(goal) not in ENDED_GOALS]

    while open_goals():
        name = plan

        def is_over(name: str = name) -> bool:
            return not open_goals() or news.plans.get(name) in dead

        over = await news.until(is_over, MISSION_S)
        if not over:
            said = {goal: (news.goals.get(goal), news.reasons.get(goal)) for goal in open_goals()}
            raise SystemExit(f"{plan} ({news.plans.get(plan)}) does not end: {said}")
        if open_goals():
            again += 1
            plan = f"{name.partition('-')[0]}-{again}"
            await _ask(soak.operator, plan, open_goals())


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--missions", type=int, default=50)
    options.add_argument("--kill-every", type=int, default=7)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(live(Path(folder), given.missions, given.kill_every, given.seed))


if __name__ == "__main__":
    main()
