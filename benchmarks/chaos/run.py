"""Missions among faults.

`python -m benchmarks.chaos.run [--faults 300] [--missions 60] [--seed 0] [--backend kinematic]`, or
`make chaos FAULTS=300 MISSIONS=60 SEED=0`. Real processes on three hosts (network namespaces, as
root): router and world, planner, workers. While they bring two cups to and fro, processes are
killed and frozen, cables are pulled, clocks are set, the power fails (logs are set back to what
was synced), disks are full, and people stop everything, take goals back and cancel plans: at random
moments, over each other.

It is judged from outside (`benchmarks.chaos.judge`, `journal`, `agreement`): no attempt begins
twice, no task is done twice, who is said to rest by a stop does not move and begins nothing,
nothing is ordered or begun of what was taken back, what was confirmed is there, planner, store and
workers agree, and each goal is true in the simulation or has failed with a reason. The exit code is
1 otherwise, and the mission's faults are printed; they belong into `violations.json`, and what
was wrong once is done `--again` by a test.
"""

from __future__ import annotations

import argparse
import asyncio
import math
import random
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from msgspec.structs import replace

from benchmarks.chaos.agreement import disagreements
from benchmarks.chaos.cancels import ChangesOfMind
from benchmarks.chaos.faults import Faults
from benchmarks.chaos.journal import Cancelled, done_twice, read_journal, reports_in
from benchmarks.chaos.judge import Judge
from benchmarks.chaos.plans import KINDS, Fault, as_text, drawn, found, one_after_another
from benchmarks.chaos.site import Site, SiteProcesses, site
from benchmarks.scale.operators.witness import Witness
from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, fleet_view
from cli.demo.mission_run import Demo, DemoOptions
from cli.demo.verdict import Verdict
from cli.errors import CliError, Refused
from cli.processes.bring_up import bring_up, router_up
from cli.processes.composition import PLANNER, ROUTER, Composition, World
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import REPORT
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.transport.session import open_session
from sim.files.mission_file import Mission, load_mission

MISSION = "two-cups"
ROOMS = {"kitchen": "kitchen", "hallway": "hallway", "living_room": "living room"}
CUPS = {"cup_1": "first", "cup_2": "second"}
DISTURBED_S = 5.0
ENDS_S, SETTLES_S = 180.0, 60.0
WRITES_EVERY_S = 0.1
AGAIN_S = 1.0
FULL_AT_START = "free some room there, and try again"


class Chaos:
    """A fleet that is disturbed, and what became of it."""

    def __init__(self, demo: Demo, faults: Faults, judge: Judge, witness: Witness, seed: int):
        self._demo, self._witness = demo, witness
        self.faults, self.judge = faults, judge
        self._rnd = random.Random(-seed - 1)
        self.ends: dict[str, int] = {}

    async def mission(self, number: int, faults: Sequence[Fault]) -> None:
        """One mission, disturbed in this way, brought to its end and judged."""
        demo, judge = self._demo, self.judge
        where = {cup: self._witness.places.get(cup) for cup in CUPS}
        goals = {cup: self._rnd.choice([r for r in ROOMS if r != where[cup]]) for cup in CUPS}
        demo.mission = replace(
            demo.mission,
            statements=tuple(
                f"The {CUPS[cup]} cup is in the {ROOMS[room]}."
                for cup, room in where.items()
                if room in ROOMS
            ),
            goals=tuple(
                f"Bring the {CUPS[cup]} cup to the {ROOMS[room]}." for cup, room in goals.items()
            ),
        )
        try:
            await demo.submit()
        except Refused as refused:
            self._count(f"refused: {refused}")
            return
        writing = asyncio.create_task(self._write())
        try:
            await self.faults.carry_out(faults)
            await demo.wait_until_ended()
        except CliError as late:
            judge.add(f"mission {number}: {late}; {self._stranded()}")
        finally:
            writing.cancel()
            await asyncio.gather(writing, return_exceptions=True)
        await self._judge_goals(number)
        if not await self._witness.until(lambda: not self._stranded(), SETTLES_S):
            judge.add(f"mission {number}: nobody is to do anything, and {self._stranded()}")
        await judge.look_for_writes(demo.session)
        await self._judge_agreement(number)
        entries = await read_journal(demo.session)
        judge.add(*done_twice(reports_in(entries)))
        cancelled = Cancelled.of(entries)
        judge.add(*cancelled.wrong)
        judge.checked["goals taken back"] = cancelled.goals
        judge.checked["plans cancelled"] = cancelled.plans

    async def _judge_goals(self, number: int) -> None:
        summary = await self._demo.verify()
        for verdict in summary.goals:
            status = self._demo.view.goal_status[verdict.goal]
            self._count(f"{status.state.value}")
            if status.state is GoalState.REACHED and verdict.physics is not Verdict.HOLDS:
                self.judge.add(f"mission {number}: {verdict.goal} counts as reached: {verdict}")
            if status.state is GoalState.FAILED and not status.reason:
                self.judge.add(f"mission {number}: {verdict.goal} has failed without a reason")

    async def _judge_agreement(self, number: int) -> None:
        """Planner, store and workers say the same, soon after nothing is to be done any more."""
        until_s = time.monotonic() + SETTLES_S
        things = {cup: f"the {words} cup" for cup, words in CUPS.items()}
        while True:
            try:
                wrong, compared = await disagreements(self._demo.session, self._demo.view, things)
            except SchemaError as error:
                wrong, compared = [str(error)], 0
            if not wrong:
                self.judge.checked["values that agree"] += compared
                return
            if time.monotonic() > until_s:
                self.judge.add(*(f"mission {number}: {each}" for each in wrong))
                return
            await asyncio.sleep(AGAIN_S)

    def _stranded(self) -> list[str]:
        plans = {plan: s.state for plan, s in self._demo.view.plan_status.items()}
        found = self._witness.stranded(plans, set())
        return [what for what in found if not what.startswith("stop")]

    async def _write(self) -> None:
        while True:
            await self.judge.write(self._demo.session)
            await asyncio.sleep(WRITES_EVERY_S)

    def _count(self, end: str) -> None:
        self.ends[end] = self.ends.get(end, 0) + 1


@asynccontextmanager
async def disturbed(
    place: Site,
    mission: Mission,
    backend: str,
    speed: str,
    seed: int,
) -> AsyncIterator[Chaos]:
    """The fleet on its hosts, from the first process to the last."""
    judge, witness = Judge(), Witness()
    processes = SiteProcesses(place)
    fleet = Composition(
        robots=tuple(robot.spec for robot in mission.robots),
        recording=None,
        data=place.folder / "data",
        world=World(MISSION, mission, backend, speed),
        apart=True,
        planner=("--no-auto-plan", "--no-approval", "--lease", "3", "--lost-after", "15"),
    )
    fleet.declare_router(processes)
    options = DemoOptions(MISSION, place.folder, backend, speed, timeout_s=ENDS_S, apart=True)
    async with processes:
        await processes.start(ROUTER)
        await router_up(processes)
        config = processes.session_config()
        async with (
            open_session(config) as session,
            open_session(config) as looking,
            fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS, REPORT, on_change=judge.see) as view,
        ):
            following = asyncio.create_task(witness.follow(looking))
            demo = Demo(options, mission, processes, session, view, time.monotonic(), set())
            await bring_up(processes, session, view, fleet)
            supervising = asyncio.create_task(_supervise(processes, judge))
            faults = Faults(processes, session, judge, ChangesOfMind(demo).change)
            try:
                yield Chaos(demo, faults, judge, witness, seed)
            finally:
                for each in (following, supervising):
                    each.cancel()
                await asyncio.gather(following, supervising, return_exceptions=True)


async def _supervise(processes: SiteProcesses, judge: Judge) -> None:
    """Start again what ended since its disk was full as it started, as `robotctl up` does, for
    ever; nothing else may end."""
    while True:
        for death in await processes.deaths():
            if FULL_AT_START not in death.sentence:
                judge.add(death.sentence)
            await asyncio.sleep(AGAIN_S)
            if processes.pid(death.name) is None:
                await processes.start(death.name)


async def live(place: Site, given: argparse.Namespace) -> list[str]:
    """So many missions; what was wrong."""
    mission = load_mission(MISSION)
    robots = [robot.spec.robot for robot in mission.robots]
    kinds = [kind for kind in given.kinds if kind not in place.lacks]
    async with disturbed(place, mission, given.backend, given.speed, given.seed) as chaos:
        did = chaos.faults.did
        for number in range(given.missions):
            began_s = time.perf_counter()
            share = math.ceil((given.faults - sum(did.values())) / (given.missions - number))
            rnd = random.Random(f"{given.seed} {number}")
            faults = drawn(rnd, share, DISTURBED_S, kinds, robots)
            if given.again and number == 0:
                faults = (*one_after_another(found()), *faults)
            wrong = len(chaos.judge.wrong)
            await chaos.mission(number, faults)
            if len(chaos.judge.wrong) > wrong:
                print(f"the faults of mission {number}: {as_text(faults)}", flush=True)
            took_s = time.perf_counter() - began_s
            print(f"mission {number}: {took_s:.1f} s, {dict(chaos.ends)}", flush=True)
        print(f"{sum(did.values())} faults: {dict(did)}")
        print(f"{given.missions} missions, goals {chaos.ends}, checked {dict(chaos.judge.checked)}")
        return chaos.judge.wrong


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--faults", type=int, default=300)
    options.add_argument("--missions", type=int, default=60)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--backend", choices=("kinematic", "mujoco"), default="kinematic")
    options.add_argument("--speed", default="10", help="simulated seconds a second")
    options.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    options.add_argument(
        "--again", action="store_true", help="in the first mission also those of violations.json"
    )
    options.add_argument("--folder", type=Path, help="where to keep data and logs")
    given = options.parse_args()
    robots = [f"worker-{robot.spec.robot}" for robot in load_mission(MISSION).robots]
    with tempfile.TemporaryDirectory() as temporary:
        folder = (given.folder or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        with site(folder, ROUTER, PLANNER, *robots) as place:
            for fault, why in place.lacks.items():
                print(f"without faults of kind {fault}: {why}", flush=True)
            try:
                wrong = asyncio.run(live(place, given))
            except (CliError, SchemaError) as error:
                wrong = [f"{type(error).__name__}: {error}"]
    for what in wrong:
        print(f"WRONG (seed {given.seed}): {what}")
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    raise SystemExit(bool(wrong))


if __name__ == "__main__":
    main()
