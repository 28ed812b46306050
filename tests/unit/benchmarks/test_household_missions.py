"""The mission suite: its files are right, its verdict can be that a mission failed, and it runs."""

from __future__ import annotations

from collections import Counter

import pytest
from msgspec.structs import replace

from benchmarks.planning.expectations import GroundTruth, parse_expectation
from benchmarks.planning.missions import CLASSES, Mission, load_missions
from benchmarks.planning.report import comparable_missions, failures_of, rows_of
from benchmarks.planning.simulated_time import Deadlock, SimulatedLoop, run
from benchmarks.planning.verdict import MissionResult, run_mission
from benchmarks.tables import as_markdown
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Place
from sim.errors import BadFile
from tests.support.household_missions import PARTS

MISSIONS: dict[str, Mission] = {mission.name: mission for mission in load_missions()}


def lying(place: str | None, support: str | None = "floor", held_by: str | None = None) -> Truth:
    return Truth(
        object="cup",
        kind="cup",
        time_s=0.0,
        point_m=(0.0, 0.0, 0.0),
        place=place,
        support=support,
        held_by=held_by,
        settled=True,
    )


def test_there_are_enough_missions_of_every_class() -> None:
    counts = Counter(mission.kind for mission in MISSIONS.values())
    assert len(MISSIONS) == sum(counts.values()) >= 60, "two missions share a name"
    assert all(counts[kind] >= 15 for kind in CLASSES)
    assert all(mission.name.startswith(mission.kind) for mission in MISSIONS.values())


@pytest.mark.parametrize("mission", MISSIONS.values(), ids=MISSIONS)
def test_a_mission_asks_for_something_that_is_not_so_yet(mission: Mission) -> None:
    """Or a planner that does nothing would succeed; but for those that say so."""
    if mission.entry.outcome == "done" and mission.name != "simple-16":
        objects = {
            name: lying(mission.start_of(name)) for name in mission.existing_world().object_entries
        }
        ground_truth = GroundTruth(objects, {}, {place.place: place for place in mission.places})
        assert not all(ground_truth.satisfies(expected) for expected in mission.final)
    assert mission.entry.goals
    assert mission.robots


@pytest.mark.parametrize("name", ["simple-01", "compound-02", "complex-05", "vague-02"])
def test_missions_of_every_class_come_out_right(name: str) -> None:
    result = run_mission(MISSIONS[name], PARTS)
    assert result.faults == ()
    assert result.tasks > 0
    assert result.makespan_s > 10.0


@pytest.mark.parametrize("name", ["simple-18", "simple-19"])
def test_what_cannot_be_done_is_refused_with_a_reason(name: str) -> None:
    result = run_mission(MISSIONS[name], PARTS)
    assert result.faults == ()
    assert result.tasks == 0
    assert result.reasons


def test_the_verdict_is_the_worlds_and_not_the_planners() -> None:
    """One mission's sentences, with another's expectations: the planner says that all is well."""
    mission = MISSIONS["simple-01"]
    mistaken = replace(mission, final=MISSIONS["simple-02"].final)
    wrong = run_mission(mistaken, PARTS).faults
    assert "not so: cup_2 in living_room" in wrong
    assert "moved for no reason: cup_1 is at hallway_table in hallway" in wrong


def test_the_same_mission_runs_the_same_way_twice() -> None:
    one, other = (run_mission(MISSIONS["complex-05"], PARTS) for _ in range(2))
    assert (one.tasks, one.makespan_s, one.reasons) == (
        other.tasks,
        other.makespan_s,
        other.reasons,
    )


def test_phrases_about_the_world() -> None:
    names = ("cup", "hsr", "kitchen", "hallway")

    def holds(text: str, there: Truth) -> bool:
        places = {"kitchen": Place(place="kitchen", label="", region_m=((0, 0, 4, 4),))}
        looks = [("kitchen", 2.0, 2.0, 4.0)]
        ground_truth = GroundTruth({"cup": there}, {}, places, {"cup": "kitchen"}, looks)
        return ground_truth.satisfies(parse_expectation(text, names, "here"))

    assert holds("cup in kitchen or hallway", lying("hallway"))
    assert not holds("cup in kitchen", lying("hallway"))
    assert not holds("cup in kitchen", lying("kitchen", None, held_by="hsr"))
    assert holds("cup held by hsr", lying("kitchen", None, held_by="hsr"))
    assert holds("cup on board hsr", lying("kitchen", "hsr"))
    assert holds("cup found", lying("kitchen"))
    assert not holds("cup found", lying("hallway"))
    assert holds("kitchen looked over", lying("kitchen"))
    with pytest.raises(BadFile, match="nothing called 'spoon'"):
        parse_expectation("spoon in kitchen", names, "here")
    with pytest.raises(BadFile, match="must look like"):
        parse_expectation("the cup is fine", names, "here")


def test_a_loop_in_which_nothing_can_happen_says_so() -> None:
    async def main(loop: SimulatedLoop) -> str:
        ended = loop.create_future()
        loop.drive(lambda: None, lambda: ended.set_exception(Deadlock("for ever")))
        try:
            await ended
        except Deadlock as stuck:
            return str(stuck)
        return ""

    assert run(main) == "for ever"


def test_tables_compare_only_what_everybody_did() -> None:
    def result(mission: str, strategy: str, tasks: int, *wrong: str) -> MissionResult:
        return MissionResult(
            mission=mission,
            kind="simple",
            planner="symbolic",
            strategy=strategy,
            outcome="done",
            faults=wrong,
            tasks=tasks,
        )

    results = [
        result("a", "big-dag", 4),
        result("a", "per-goal", 6),
        result("b", "big-dag", 40),
        result("b", "per-goal", 0, "not so: cup | in kitchen"),
    ]
    assert comparable_missions(results) == {"a"}
    rows = {row[1:4]: row[4] for row in rows_of(results) if row[2] == "all"}
    assert rows == {("big-dag", "all", "2/2"): "4.0", ("per-goal", "all", "1/2"): "6.0"}
    (failure,) = failures_of(results)
    assert failure[:2] == ("b", "symbolic per-goal")
    assert as_markdown(("x",), [(failure[2],)]).endswith("| not so: cup \\| in kitchen |")
