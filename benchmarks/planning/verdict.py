"""Runs a mission; its verdict is by the simulated world, not by what the planner says of it."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import msgspec

from benchmarks.planning.expectations import GroundTruth
from benchmarks.planning.fleet_run import FleetRun
from benchmarks.planning.missions import Mission
from benchmarks.planning.simulated_time import SimulatedLoop, run
from fleet.service.composition import Composition
from keyexpr_schema.facts import IS_OPEN
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.simulation import Truth
from sim.states import ThingStates


class MissionResult(msgspec.Struct, frozen=True, kw_only=True):
    """How one mission went. `faults` lists what should be so and is not; empty is success.

    `planning_s` is CPU time; `makespan_s` simulated. `tasks` counts the tasks that robots began.
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
) -> MissionResult:
    """Run one mission from its beginning to its end and look at the world then."""

    async def main(loop: SimulatedLoop) -> MissionResult:
        fleet = FleetRun(mission, parts, planner, strategy, loop)
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
    yield from fleet.misconduct
    yield from _changed_for_no_reason(mission, ground_truth)
    reached = [s.state is GoalState.REACHED for s in fleet.goals.values()]
    if outcome == "done":
        if len(reached) < len(mission.goals) or not all(reached):
            yield "the planner does not say that every goal is reached"
        return
    if all(reached):
        yield f"it should be {outcome}, and the planner says that every goal is reached"
    reasons = " ".join(fleet.refusals()).lower()
    if not reasons:
        yield f"it should be {outcome} with a reason, and there is none"
    elif missing := [word for word in mission.entry.says if word.lower() not in reasons]:
        yield f"the reasons do not say {', '.join(missing)}"
    if outcome == "refused" and fleet.counts.tasks:
        yield f"it should be refused, and robots began {fleet.counts.tasks} tasks"


def _changed_for_no_reason(mission: Mission, ground_truth: GroundTruth) -> Iterator[str]:
    """Things that lie elsewhere, and states that are otherwise, that no phrase speaks of."""
    phrases = (*mission.final, *(e for stage in mission.stages for e in stage))
    named = {s for e in phrases if e.form != "known" for s in e.subjects}
    named |= {*mission.entry.may_change, *mission.entry.moves}
    before = ThingStates(mission.existing_world())
    for thing, now in ground_truth.objects.items():
        if thing in named:
            continue
        place = ground_truth.place_of(thing)
        if thing in mission.world.object_entries and (place, now.support) != (
            mission.start_of(thing),
            mission.start_carrier(thing),
        ):
            if place is None:
                yield f"moved for no reason: {thing} is in a hand"
            elif not _carried_along(ground_truth, now, named):
                yield f"moved for no reason: {thing} is at {now.support} in {place}"
        for state, value in now.states.items():
            # Doors may be left open.
            if state != IS_OPEN and value != before.get(thing, state):
                yield f"changed for no reason: {state}({thing}) is {value}"


def _carried_along(ground_truth: GroundTruth, thing: Truth, named: Collection[str]) -> bool:
    """Whether what it is on or in was to be moved."""
    below = ground_truth.objects.get(thing.support or "")
    return below is not None and (
        below.object in named or _carried_along(ground_truth, below, named)
    )
