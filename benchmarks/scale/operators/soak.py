"""Five hundred missions among people who do things by chance, and processes that are killed.

`python -m benchmarks.scale.operators.soak [--missions 500] [--seed 0]`, or as the part `operators`
of `benchmarks.scale.run`. Real processes: router, planner, two worker processes, and a kinematic
world in which durations vary and grasps fail; six robots with small batteries, three cups.

While a mission goes on people pause, drain, stop, close, cancel, delete, try again and so on, at
any moment, and one of the processes gets `kill -9` now and then. After each mission all that holds
is ended. Then every goal has to be reached (in the world, unless somebody has said otherwise),
deleted, or failed with a true reason; no task may have been done twice; and nobody may be stranded:
empty, held, with an order of a plan that is over, or something in the hand that nobody wants.
"""

from __future__ import annotations

import argparse
import asyncio
import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.scale.operators.actions import Operators
from benchmarks.scale.operators.growth import FLAT_PERCENT, growth
from benchmarks.scale.operators.witness import Witness
from benchmarks.scale.processes import REALM, Processes
from benchmarks.scale.simulated_fleet import WORLD_RUNS, SimulatedFleet, building, simulated_in
from benchmarks.scale.soak import MISSION_S, Lived, Restart, Soak, soaking, summed_up
from benchmarks.tables import as_json
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import ENDED_PLANS
from keyexpr_schema.transport.session import SessionConfig, open_session

ROBOTS, WORKERS, PEOPLE = 6, 2, 4
DISTURBED_S = 0.7
"""For how long a mission is disturbed."""
BATTERY = {
    "capacity_wh": 8, "idle_w": 10, "driving_w": 60, "working_w": 45, "charging_w": 600
}  # fmt: skip
AGAIN_S, AGAIN_MOST_S = 0.25, 4.0
"""Who is refused a plan asks again after so long, and each time after twice as long, wall [s]."""
MISSIONS, KILL_EVERY, LIMIT_S = 500, 10, 3600.0
SETTLE_EVERY = 20
"""After so many missions it is looked whether anybody is stranded."""


@dataclass
class Outcome:
    """What became of the missions; `wrong` is what should not have been."""

    lived: list[Lived] = field(default_factory=list)
    ends: Counter[str] = field(default_factory=Counter)
    did: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    tasks: int = 0
    twice: int = 0


def _with_batteries(fleet: Processes, seed: int) -> AbstractAsyncContextManager[SimulatedFleet]:
    module = f"{__package__}.exchanging_world"

    def world(mission: Path) -> object:
        return fleet.module(module, "sim", (WORLD_RUNS,), str(mission), "--seed", str(seed))

    return simulated_in(fleet, building(ROBOTS, BATTERY), world, WORKERS)  # type: ignore[arg-type]


class DisturbedMissions:
    """Missions among operators."""

    def __init__(self, soak: Soak, witness: Witness, seed: int) -> None:
        self._soak, self._witness = soak, witness
        self._operators = Operators(soak, seed)
        self._rnd = random.Random(-seed)
        self.outcome = Outcome()

    async def mission(self, number: int, kill: bool) -> None:
        """One of them, disturbed and then brought to its end."""
        soak, operators, mission = self._soak, self._operators, f"m{number}"
        had_s, began_s = soak.cpu_s(), time.perf_counter()
        self._witness.look_anew()
        goals = await soak.put_goals(number)
        await operators.ask(mission, goals)
        people = [asyncio.create_task(operators.disturb(mission, goals)) for _ in range(PEOPLE)]
        killing = asyncio.create_task(self._kill()) if kill else None
        await soak.news.until(partial(self._all_ended, goals), DISTURBED_S)
        for one in people:
            one.cancel()
        for error in await asyncio.gather(*people, return_exceptions=True):
            if error is not None and not isinstance(error, asyncio.CancelledError):
                raise error
        while killing is not None and not killing.done():  # a worker waits for its registration
            with suppress(SchemaError):
                await operators.end(self._witness.empty)
            await asyncio.wait({killing}, timeout=1.0)
        restart = None if killing is None else await killing
        await operators.end(self._witness.empty)
        if not await self._witness.until(lambda: not self._witness.holding(), MISSION_S):
            self._wrong(mission, f"held: {self._witness.holding()}")
        await self._until_over(mission, goals)
        await self._try_again(mission, goals)
        self._judge(mission, goals)
        await operators.look(self._witness.places, self._witness.held)
        lived = soak.lived(number, time.perf_counter() - began_s, had_s)
        self.outcome.lived.append(replace(lived, restart=restart))
        self.outcome.did, self.outcome.tasks = operators.did, len(self._witness.succeeded)

    async def settle(self) -> None:
        """Wait until nobody has anything to do, and say who still has."""
        witness = self._witness
        while await witness.until(lambda: not self._stranded() or bool(witness.empty), MISSION_S):
            if not self._stranded():
                return
            await self._operators.end(witness.empty)  # batteries that somebody had made low
            if not await witness.until(lambda: not witness.empty, MISSION_S):
                break
        self._wrong("settling", f"stranded: {self._stranded()}")

    def _stranded(self) -> list[str]:
        return self._witness.stranded(self._soak.news.plans, self._operators.told)

    async def _kill(self) -> Restart:
        await asyncio.sleep(self._rnd.uniform(0.0, DISTURBED_S / 2))
        restart = await self._soak.restart()
        self._operators.did[f"kill {restart.name}"] += 1
        return restart

    def _all_ended(self, goals: list[str]) -> bool:
        return all(self._soak.news.goals.get(goal) in ENDED_GOALS for goal in goals)

    async def _until_over(self, mission: str, goals: list[str]) -> None:
        """Until the goals have ended; asks for another plan where one was cancelled or refused."""
        news, again = self._soak.news, 0
        pause_s = AGAIN_S

        def open_goals() -> list[str]:
            left = (goal for goal in goals if goal not in self._operators.deleted)
            return [goal for goal in left if news.goals.get(goal) not in ENDED_GOALS]

        def unplanned() -> list[str]:
            waiting = [g for g in open_goals() if news.goals.get(g) is GoalState.WAITING]
            plans = [s for p, s in news.plans.items() if p.partition("-")[0] == mission]
            return waiting if all(state in ENDED_PLANS for state in plans) else []

        while open_goals():
            if not await news.until(lambda: not open_goals() or bool(unplanned()), MISSION_S):
                said = {g: (news.goals.get(g), news.reasons.get(g)) for g in open_goals()}
                plans = {p: s for p, s in news.plans.items() if p.startswith(mission)}
                self._wrong(mission, f"does not end: {said}, {plans}; {self._stranded()}")
                for goal in open_goals():
                    await self._operators.delete(goal)
            if open_goals():
                again += 1
                await self._operators.ask(f"{mission}-{again}", unplanned())
                await asyncio.sleep(pause_s)  # what was refused is most likely so again at once
                pause_s = min(2.0 * pause_s, AGAIN_MOST_S)

    def _judge(self, mission: str, goals: list[str]) -> None:
        news, operators, outcome = self._soak.news, self._operators, self.outcome
        for number, goal in enumerate(goals):
            state = news.goals[goal]
            if goal in operators.deleted:
                outcome.ends["deleted"] += 1
                continue
            outcome.ends[state.value] += 1
            if state is GoalState.REACHED:
                cup, room = f"cup_{number}", self._soak.room(int(mission[1:]), number)
                been = self._witness.been[cup]
                if room not in been and cup not in operators.said:
                    self._wrong(mission, f"{goal} counts as reached, but {cup} was in {been}")
            else:
                self._judge_reason(mission, goal)
        if self._witness.twice:
            self._wrong(mission, f"done twice: {self._witness.twice}")
            outcome.twice += len(self._witness.twice)
            for task in self._witness.twice:
                del self._witness.succeeded[task]
        for robot in self._witness.emptied:
            if robot not in operators.exchanged:
                self._wrong(mission, f"{robot} ran empty")
        self._witness.emptied.clear()
        operators.exchanged -= self._witness.full

    def _judge_reason(self, mission: str, goal: str) -> None:
        reason, lost = self._soak.news.reasons[goal], self._operators.lost
        if reason is None or not self._witness.is_true(reason, lost):
            self._wrong(mission, f"{goal} failed with the reason {reason}")
        else:
            self.outcome.reasons[reason] += 1

    async def _try_again(self, mission: str, goals: list[str]) -> None:
        """Half of the goals that have failed are wanted once more."""
        news = self._soak.news
        for goal in goals:
            failed = goal not in self._operators.deleted and news.goals[goal] is GoalState.FAILED
            if not failed or self._rnd.random() < 0.5:
                continue
            self._judge_reason(mission, goal)
            await self._operators.want_again(goal)
            wanted = partial(lambda goal: news.goals[goal] is not GoalState.FAILED, goal)
            if not await news.until(wanted, MISSION_S):
                self._wrong(mission, f"{goal} was wanted again, and is failed")
        await self._until_over(mission, goals)

    def _wrong(self, mission: str, what: str) -> None:
        print(f"WRONG in {mission}: {what}", flush=True)
        kept = self._soak.fleet.folder / f"wrong-{mission.replace(' ', '-')}"
        if not kept.exists():  # the journal of it, before that is cut
            shutil.copytree(self._soak.fleet.folder / "planner", kept)
        self.outcome.wrong.append(f"{mission}: {what}")


@asynccontextmanager
async def _among_operators(folder: Path, seed: int) -> AsyncIterator[DisturbedMissions]:
    async with soaking(folder, partial(_with_batteries, seed=seed)) as soak:
        # By a session of its own: one hears its own puts, also those that get no further.
        config = SessionConfig((soak.fleet.endpoint,), realm=REALM, component="witness")
        async with open_session(config) as session:
            witness = Witness()
            following = asyncio.create_task(witness.follow(session))
            try:
                yield DisturbedMissions(soak, witness, seed)
            finally:
                following.cancel()
                await asyncio.gather(following, return_exceptions=True)


async def live(
    folder: Path, missions: int, kill_every: int, seed: int, limit_s: float = LIMIT_S
) -> Outcome:
    """So many missions, or as many as there are in `limit_s`, and what became of them."""
    until_s = time.perf_counter() + limit_s
    async with _among_operators(folder, seed) as disturbed:
        for number in range(missions):
            await disturbed.mission(number, kill=bool(number) and number % kill_every == 0)
            one = disturbed.outcome.lived[-1]
            print(f"mission {number}: {one.took_s:.1f} s {one.restart or ''}", flush=True)
            if (number + 1) % SETTLE_EVERY == 0:
                await disturbed.settle()
            if time.perf_counter() > until_s:
                break
        await disturbed.settle()
        return disturbed.outcome


def rows_of(outcome: Outcome) -> list[dict[str, Any]]:
    """A row for each tenth of the missions; with the last stands what there was in all."""
    rows = summed_up(outcome.lived)
    in_all = {
        "goals": dict(outcome.ends),
        "actions": dict(outcome.did),
        "reasons": dict(outcome.reasons.most_common()),
        "wrong": outcome.wrong,
        "twice": outcome.twice,
        "tasks": outcome.tasks,
        "growth_percent": growth(outcome.lived),
    }
    rows[-1] |= in_all
    return rows


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--missions", type=int, default=MISSIONS)
    options.add_argument("--kill-every", type=int, default=KILL_EVERY)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--folder", type=Path, help="where to keep data and logs")
    options.add_argument("--limit-s", type=float, default=LIMIT_S)
    options.add_argument("--rows", type=Path, help="a file for what was measured")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        outcome = asyncio.run(
            live(folder, given.missions, given.kill_every, given.seed, given.limit_s)
        )
    print(f"{len(outcome.lived)} missions: {dict(outcome.ends)}; {outcome.tasks} tasks")
    print(f"did: {dict(outcome.did)}")
    for reason, count in outcome.reasons.most_common():
        print(f"{count} x {reason}")
    for what in outcome.wrong:
        print(f"WRONG: {what}")
    for name, percent in growth(outcome.lived).items():
        flat = "flat" if percent < FLAT_PERCENT else "GROWS"
        print(f"{name}: {percent:+.1f} % in 100 missions: {flat}")
    if given.rows is not None:
        given.rows.write_text(as_json({"results": rows_of(outcome)}), encoding="utf-8")


if __name__ == "__main__":
    main()
