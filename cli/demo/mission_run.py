"""One mission, from the first process to the verdict."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, FleetView, fleet_view
from cli.client.planner_requests import ask_planner, request_name
from cli.client.publish import put_goal, put_statement
from cli.demo.summary import Summary, task_lines, times
from cli.demo.verdict import all_agreed, concerned, goal_verdicts
from cli.errors import Refused, TooLate
from cli.processes.bring_up import bring_up, router_up
from cli.processes.child_processes import ChildProcesses, free_endpoint
from cli.processes.composition import ROUTER, Composition, World
from cli.processes.run_folder import DATA, RECORDING, claim_run_folder
from keyexpr_schema.facts import AT
from keyexpr_schema.keyspace import SIM_SENSES
from keyexpr_schema.payloads.goals import GoalState, GoalStatus
from keyexpr_schema.payloads.requests import PlanRequest
from keyexpr_schema.transport.session import Session, open_session
from sim.files.mission_file import Mission, load_mission
from sim.files.world_payloads import object_payloads

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Change

SETTLE_S = 60.0
"""How long objects may take to come to rest after the last goal has ended [s, wall]."""
READ_S = 30.0
PLAN_S = 120.0
REALM = "demo"


@dataclass(frozen=True)
class DemoOptions:
    """`speed` is simulated seconds a second, or `max`; `timeout_s` bounds the plan's execution.

    Workers are one process, or `apart`; see `Composition`.
    """

    mission: str
    out: Path
    backend: str = "mujoco"
    speed: str = "max"
    view: bool = False
    timeout_s: float = 600.0
    apart: bool = False
    programs: bool = False
    """Whether the plan is carried out as programs."""
    zenoh_config: Path | None = None

    def composition(self, mission: Mission) -> Composition:
        """Which processes carry the mission out."""
        return Composition(
            robots=tuple(robot.spec for robot in mission.robots),
            recording=self.out / RECORDING,
            data=self.out / DATA,
            world=World(self.mission, mission, self.backend, self.speed),
            apart=self.apart,
            view=self.view,
            # One plan for all goals, which nobody is asked about: whatever robotctl.yaml says.
            planner=("--no-auto-plan", "--no-approval"),
        )


@dataclass
class Demo:
    """A running demo; made by `running_demo`. `view` is what its `processes` publish."""

    options: DemoOptions
    mission: Mission
    processes: ChildProcesses
    session: Session
    view: FleetView
    started_at_s: float
    """Seconds of `time.monotonic` when the first process was started."""
    visited: set[str]
    """The places in which the simulation has had a robot."""
    goals: tuple[str, ...] = ()
    _clock_from: tuple[float, float] | None = None
    _clock_to: tuple[float, float] | None = None

    async def submit(self) -> None:
        """Publish the mission's statements and goals, and ask for one plan for all of them.

        Raises:
            Refused: the planner does not understand a goal, or cannot plan; the message says why.
        """
        for text in self.mission.statements:
            await put_statement(self.session, text)
        speaker = self.mission.speaker
        given = [
            await put_goal(self.session, text, None, speaker=speaker) for text in self.mission.goals
        ]
        self.goals = tuple(goal.goal for goal in given)
        await self.view.until_read(self.goals, "the goals", READ_S, PLAN_S)
        for status in self._statuses().values():
            if status.state is GoalState.REJECTED:
                raise Refused(f"goal {status.goal} is rejected: {status.reason}")
        asked = self.mission.plan
        default = PlanRequest(request=request_name())
        self._clock_from = self._clock()
        await ask_planner(
            self.session,
            PlanRequest(
                request=default.request,
                goals=self.goals,
                strategy=asked.strategy or default.strategy,
                planner=asked.planner or default.planner,
                allocator=asked.allocator or default.allocator,
                programs=self.options.programs,
            ),
            PLAN_S,
        )

    async def wait_until_ended(self) -> None:
        """Wait until the planner has given its last word on every goal.

        Raises:
            TooLate: it had not after `options.timeout_s`; the message names the goals.
        """
        try:
            await self.view.until(
                lambda: self.view.ended(self.goals), self.options.timeout_s, "the goals to end"
            )
        except TooLate:
            status = self._statuses()
            still = [
                f"{goal} ({status[goal].state.value})" if goal in status else goal
                for goal in self.goals
                if not self.view.ended((goal,))
            ]
            raise TooLate(
                f"after {self.options.timeout_s:g} s these goals have not ended: "
                f"{', '.join(still)}; the logs are in {self.options.out}"
            ) from None
        finally:
            self._clock_to = self._clock()

    async def verify(self) -> Summary:
        """Wait until what is true has settled, and hold the goals against it."""
        view = self.view
        ended_s = max((s.time_s for s in self._statuses().values()), default=0.0)

        # The simulation repeats every truth. Only what it said after the goals had ended counts,
        # whatever the clocks of those who reported the end.
        old_truths, old_contacts = dict(view.truths), view.contacts

        def settled() -> bool:
            return (
                bool(view.truths)
                and view.contacts is not old_contacts
                and all(
                    truth is not old_truths.get(name) and truth.time_s >= ended_s
                    for name, truth in view.truths.items()
                )
                and all(
                    view.truths[name].settled or view.truths[name].held_by is not None
                    for name in concerned(self._statuses().values(), view.truths)
                )
            )

        # Where one does not settle, its goal's verdict says so, and fails.
        with suppress(TooLate):
            await view.until(settled, SETTLE_S, "the objects to come to rest")
        robots = [robot.spec.robot for robot in self.mission.robots]
        places = {robot: senses.place for robot, senses in view.senses.items()}
        beliefs = {
            thing: fact.value for (relation, thing), fact in view.facts.items() if relation == AT
        }
        objects = {thing.object: thing for thing in object_payloads(self.mission.world)}
        wholes = {name: entry.part_of for name, entry in self.mission.world.place_entries.items()}
        verdicts = goal_verdicts(
            self._statuses(), view.truths, places, beliefs, objects, wholes, self.visited
        )
        records = list(view.tasks.values())
        makespan_s, busy_s, idle_s = times(records, robots)
        recording = self.options.out / RECORDING
        return Summary(
            mission=self.mission.mission,
            backend=self.options.backend,
            ok=len(verdicts) == len(self.goals) and all_agreed(verdicts),
            goals=verdicts,
            tasks=task_lines(records),
            revisions={plan: status.revision for plan, status in view.plan_status.items()},
            makespan_s=makespan_s,
            busy_s=busy_s,
            idle_s=idle_s,
            contacts=view.contacts,
            wall_s=time.monotonic() - self.started_at_s,
            real_time_factor=self._real_time_factor(),
            out=str(self.options.out),
            recording=str(recording) if recording.is_file() else None,
        )

    def _statuses(self) -> dict[str, GoalStatus]:
        status = self.view.goal_status
        return {goal: status[goal] for goal in self.goals if goal in status}

    def _clock(self) -> tuple[float, float] | None:
        clock = self.view.clock
        return None if clock is None else (clock.time_s, clock.wall_time_s)

    def _real_time_factor(self) -> float | None:
        if self._clock_from is None or self._clock_to is None:
            return None
        wall_s = self._clock_to[1] - self._clock_from[1]
        return (self._clock_to[0] - self._clock_from[0]) / wall_s if wall_s > 0.0 else None


@asynccontextmanager
async def running_demo(
    options: DemoOptions, on_change: Callable[[Change[Any, Any]], None] | None = None
) -> AsyncIterator[Demo]:
    """Start every process of a mission and wait until each shows by its keys that it is ready.

    At the end of the block every process is ended. Work in the block should go through
    `demo.processes.guard`, so that a death is noticed.

    Raises:
        BadArgument: a run lies in `options.out` already.
        ProcessDied: a process ended before it was ready.
        TooLate: a process was not ready after `READY_S`.
    """
    mission = load_mission(options.mission)
    visited: set[str] = set()

    def heard(change: Change[Any, Any]) -> None:
        if change.key is SIM_SENSES and change.value is not None and change.value.place:
            visited.add(change.value.place)
        if on_change is not None:
            on_change(change)

    claim_run_folder(options.out)
    started_at_s = time.monotonic()
    processes = ChildProcesses(free_endpoint(), REALM, options.out, options.zenoh_config)
    fleet = options.composition(mission)
    fleet.declare_router(processes)
    async with processes:
        await processes.start(ROUTER)
        await processes.guard(router_up(processes))
        config = processes.session_config()
        async with (
            open_session(config) as session,
            fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS, on_change=heard) as view,
        ):
            demo = Demo(options, mission, processes, session, view, started_at_s, visited)
            await processes.guard(bring_up(processes, session, view, fleet))
            yield demo
