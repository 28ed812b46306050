"""Runs a mission; its verdict is by the simulated world, not by what the planner says of it."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from benchmarks.planning.fleet_run import FleetRun
from benchmarks.planning.missions import Mission
from benchmarks.planning.simulated_time import SimulatedLoop, run
from fleet.planners import LlmInterpreter
from fleet.service.composition import Composition
from keyexpr_schema.payloads.goals import GoalState


class MissionResult(msgspec.Struct, frozen=True, kw_only=True):
    """How one mission went. `faults` lists what should be so and is not; empty is success.

    `planning_s` is wall time; `makespan_s` simulated. `tasks` counts the tasks that robots began.
    """

    mission: str
    kind: str
    planner: str
    strategy: str
    outcome: str
    faults: tuple[str, ...]
    reasons: tuple[str, ...] = ()
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
        return not self.faults


def run_mission(
    mission: Mission,
    parts: Composition,
    planner: str = "symbolic",
    strategy: str = "big-dag",
    interpreter: LlmInterpreter | None = None,
) -> MissionResult:
    """Run one mission from its beginning to its end and look at the world then."""

    async def main(loop: SimulatedLoop) -> MissionResult:
        fleet = FleetRun(mission, parts, planner, strategy, loop, interpreter)
        broken = await fleet.run()
        counts = fleet.counts
        faults = [broken] if broken else []
        faults += _faults(mission, fleet)
        return MissionResult(
            mission=mission.name,
            kind=mission.kind,
            planner=planner,
            strategy=strategy,
            outcome=mission.entry.outcome,
            faults=tuple(faults),
            reasons=tuple(dict.fromkeys([*fleet.refusals(), *counts.reasons])),
            tasks=counts.tasks,
            failed_tasks=counts.failed_tasks,
            revisions=counts.revisions,
            rounds=counts.rounds,
            tokens=counts.tokens,
            fallbacks=counts.fallbacks,
            planning_s=counts.planning_s,
            makespan_s=fleet.backend.time_s,
        )

    result: MissionResult = run(main)
    return result


def _faults(mission: Mission, fleet: FleetRun) -> Iterator[str]:
    outcome = mission.entry.outcome
    ground_truth = fleet.ground_truth()
    for expected in mission.final:
        if not ground_truth.satisfies(expected):
            yield f"not so: {expected.text}"
    for number, stage in enumerate(mission.stages[fleet.stage :], fleet.stage + 1):
        yield f"stage {number} never came to be: {', '.join(expected.text for expected in stage)}"
    named = {
        subject
        for expected in (*mission.final, *(e for stage in mission.stages for e in stage))
        if expected.form != "known"
        for subject in expected.subjects
    }
    for thing in ground_truth.objects:
        if thing not in named and ground_truth.place_of(thing) != mission.start_of(thing):
            yield f"moved for no reason: {thing} is in {ground_truth.place_of(thing) or 'a hand'}"
    reached = [s.state is GoalState.REACHED for s in fleet.state.goal_states.values()]
    if outcome == "done":
        if not all(reached):
            yield "the planner does not say that every goal is reached"
        return
    if all(reached):
        yield f"it should be {outcome}, and the planner says that every goal is reached"
    if not fleet.refusals():
        yield f"it should be {outcome} with a reason, and there is none"
    if outcome == "refused" and fleet.counts.tasks:
        yield f"it should be refused, and robots began {fleet.counts.tasks} tasks"
