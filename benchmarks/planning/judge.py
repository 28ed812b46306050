"""Runs a mission and judges it by the simulated world, not by what the planner says of it."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from benchmarks.planning.fleet_run import FleetRun
from benchmarks.planning.missions import Mission
from benchmarks.planning.simulated_time import SimulatedLoop, run
from fleet.planners import LlmInterpreter
from fleet.service.composition import Composition
from keyexpr_schema.payloads.goals import GoalState


class Result(msgspec.Struct, frozen=True, kw_only=True):
    """How one mission went. `wrong` lists what should be true and is not; empty is success.

    `planning_s` is wall time; `makespan_s` simulated. `tasks` counts the tasks that robots began.
    """

    mission: str
    kind: str
    planner: str
    strategy: str
    expect: str
    wrong: tuple[str, ...]
    said: tuple[str, ...] = ()
    """What the fleet gave as reasons."""
    tasks: int = 0
    failed_tasks: int = 0
    revisions: int = 0
    rounds: int = 0
    tokens: int = 0
    fallbacks: int = 0
    planning_s: float = 0.0
    makespan_s: float = 0.0

    @property
    def success(self) -> bool:
        """Whether what should be true is."""
        return not self.wrong


def run_mission(
    mission: Mission,
    parts: Composition,
    planner: str = "symbolic",
    strategy: str = "big-dag",
    interpreter: LlmInterpreter | None = None,
) -> Result:
    """Run one mission from its beginning to its end and look at the world then."""

    async def main(loop: SimulatedLoop) -> Result:
        fleet = FleetRun(mission, parts, planner, strategy, loop, interpreter)
        broken = await fleet.run()
        counts = fleet.counts
        wrong = [broken] if broken else []
        wrong += _wrong(mission, fleet)
        return Result(
            mission=mission.name,
            kind=mission.kind,
            planner=planner,
            strategy=strategy,
            expect=mission.entry.expect,
            wrong=tuple(wrong),
            said=tuple(dict.fromkeys([*fleet.refusals(), *counts.reasons])),
            tasks=counts.tasks,
            failed_tasks=counts.failed_tasks,
            revisions=counts.revisions,
            rounds=counts.rounds,
            tokens=counts.tokens,
            fallbacks=counts.fallbacks,
            planning_s=counts.planning_s,
            makespan_s=fleet.backend.time_s,
        )

    result: Result = run(main)
    return result


def _wrong(mission: Mission, fleet: FleetRun) -> Iterator[str]:
    expect = mission.entry.expect
    witness = fleet.witness()
    for truth in mission.truth:
        if not witness.sees(truth):
            yield f"not so: {truth.text}"
    for number, stage in enumerate(mission.stages[fleet.stage :], fleet.stage + 1):
        yield f"stage {number} never came to be: {', '.join(truth.text for truth in stage)}"
    named = {
        subject
        for truth in (*mission.truth, *(t for stage in mission.stages for t in stage))
        if truth.form != "known"
        for subject in truth.subjects
    }
    for thing in witness.objects:
        if thing not in named and witness.place_of(thing) != mission.start_of(thing):
            yield f"moved for no reason: {thing} is in {witness.place_of(thing) or 'a hand'}"
    reached = [s.state is GoalState.REACHED for s in fleet.state.goal_states.values()]
    if expect == "done":
        if not all(reached):
            yield "the planner does not say that every goal is reached"
        return
    if all(reached):
        yield f"it should be {expect}, and the planner says that every goal is reached"
    if not fleet.refusals():
        yield f"it should be {expect} with a reason, and there is none"
    if expect == "refused" and fleet.counts.tasks:
        yield f"it should be refused, and robots began {fleet.counts.tasks} tasks"
