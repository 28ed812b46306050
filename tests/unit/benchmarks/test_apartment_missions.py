"""The missions in the apartment: some of them run, and what judges them can say no."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from benchmarks.planning.embodiments import SharedWorld
from benchmarks.planning.expectations import GroundTruth, parse_expectation
from benchmarks.planning.household_world import (
    Deed,
    HouseholdWorld,
    filling,
    lifting,
    locking_up,
    lowering,
    mopping,
    pouring,
    serving,
    slicing,
)
from benchmarks.planning.mishaps import UNREGISTERED_AFTER_S, Mishap, Mishaps
from benchmarks.planning.missions import Mission, load_missions
from benchmarks.planning.verdict import run_mission
from keyexpr_schema.payloads.motions import MotionState
from keyexpr_schema.payloads.simulation import Truth
from sim.errors import BadFile
from tests.support.household_missions import PARTS

MISSIONS: dict[str, Mission] = {mission.name: mission for mission in load_missions("apartment")}
FAST = (
    "02",
    "05",
    "07",
    "18",
    "22",
    "26",
    "32",
    "34",
    "36",
    "41",
    "44",
    "46",
    "52",
    "59",
    "60",
    "61",
)
"""On and in, the fridge, heat, a jug, a knife, two robots, a search, mishaps, never, refusals, a
task that has a name."""


def test_there_are_over_sixty_and_refusals_say_what_is_missing() -> None:
    assert len(MISSIONS) >= 60
    refused = [m.entry for m in MISSIONS.values() if m.entry.outcome == "refused"]
    assert len(refused) >= 8
    assert all(entry.says for entry in refused)


@pytest.mark.parametrize("number", FAST)
def test_missions_in_the_apartment_come_out_right(number: str) -> None:
    mission = MISSIONS[f"apartment-{number}"]
    result = run_mission(mission, PARTS)
    assert result.faults == ()
    assert (result.tasks > 0) is (mission.entry.outcome == "done")


def test_the_verdict_sees_what_a_planner_does_not_say() -> None:
    """The milk goes into the fridge as asked, and everything that was expected is otherwise."""
    mission = MISSIONS["apartment-05"]
    names = (*mission.world.object_entries, *mission.world.fixture_of, *mission.world.place_entries)
    mistaken = replace(
        mission,
        final=tuple(
            parse_expectation(text, names, "here")
            for text in ("milk_1 on kitchen_table", "is_open(fridge) is true", "milk_1 with anna")
        ),
        never=(parse_expectation("is_open(fridge) is true", names, "here"),),
        always=(parse_expectation("milk_1 in kitchen_table", names, "here"),),
        entry=replace(mission.entry, states={}),
    )
    faults = run_mission(mistaken, PARTS).faults
    assert "not so: milk_1 on kitchen_table" in faults
    assert "not so: is_open(fridge) is true" in faults
    assert "not so: milk_1 with anna" in faults
    assert "it was so on the way: is_open(fridge) is true" in faults
    assert "it was not so on the way: milk_1 in kitchen_table" in faults


def test_what_was_moved_or_changed_and_not_spoken_of_is_a_fault() -> None:
    mission = MISSIONS["apartment-18"]  # the pot gets hot, and the board beside it too
    names = (*mission.world.object_entries, *mission.world.fixture_of)
    one = parse_expectation("temperature(pot_1) is hot", names, "here")
    unspoken = replace(
        mission, final=(one,), stages=(), entry=replace(mission.entry, may_change=())
    )
    assert run_mission(unspoken, PARTS).faults == (
        "changed for no reason: temperature(board_1) is hot",
    )


def test_a_refusal_that_does_not_say_what_is_missing_is_a_fault() -> None:
    mission = MISSIONS["apartment-59"]
    silent = replace(mission, entry=replace(mission.entry, says=("spoon",)))
    assert run_mission(silent, PARTS).faults == ("the reasons do not say spoon",)


def worked(deed: Deed, prepare: Callable[[HouseholdWorld], None] = lambda world: None) -> str:
    """What a piece of work of hsr's comes to in the apartment; "" if it is done."""
    mission = MISSIONS["apartment-49"]
    world = HouseholdWorld(mission.existing_world(), mission.robots)
    prepare(world)
    world.begin_work("hsr", 5.0, deed)
    while world.is_running("hsr"):
        world.advance()
    outcome = world.outcome("hsr")
    assert outcome is not None
    assert world.time_s >= 5.0
    return "" if outcome.state is MotionState.SUCCEEDED else str(outcome.reason)


@pytest.mark.parametrize(
    ("deed", "why"),
    [
        (slicing("bread_1"), "hsr has no knife in its hand"),
        (mopping("kitchen"), "hsr has no mop in its hand"),
        (filling("sink"), "hsr has no jug in its hand"),
        (pouring("glass_1", "filled"), "hsr has no jug in its hand"),
        (serving("dining_table"), "0 dishes are on dining_table, and not 3"),
        (lifting("folding_table_1", "butler"), "hsr is not where folding_table_1 is"),
        (lowering("folding_table_1", "butler"), "hsr and butler do not both have folding_table_1"),
        (locking_up("hallway"), ""),
    ],
)
def test_the_world_lets_nobody_work_without_a_tool(deed: Deed, why: str) -> None:
    assert worked(deed).startswith(why)
    assert bool(worked(deed)) is bool(why)


def test_work_counts_what_is_there() -> None:
    def lay_the_table(world: HouseholdWorld) -> None:
        for dish in ("plate_1", "mug_1", "glass_2"):
            world.put(dish, "dining_table")

    assert worked(serving("dining_table"), lay_the_table) == ""


def test_a_robot_that_is_stopped_at_work_has_done_nothing() -> None:
    mission = MISSIONS["apartment-49"]
    world = HouseholdWorld(mission.existing_world(), mission.robots)
    world.begin_work("hsr", 5.0, locking_up("hallway"))
    world.stop("hsr")
    for _ in range(200):
        world.advance()
    assert world.time_s > 5.0
    assert world.state_of("hallway", "locked_up") is None
    assert SharedWorld(world).advance() is None


def test_mishaps_come_in_their_order_and_once() -> None:
    mishaps = Mishaps(replace(MISSIONS["apartment-44"].entry, dies={"hsr_2": 2.0}))
    assert mishaps.next_s == 2.0
    assert list(mishaps.due(5.0)) == [(Mishap.DIES, "hsr_2"), (Mishap.MOVED, "apple_1")]
    assert list(mishaps.due(2.0 + UNREGISTERED_AFTER_S)) == [(Mishap.UNREGISTERED, "hsr_2")]
    assert mishaps.next_s is None


def test_phrases_about_what_is_on_and_in_and_how_things_are() -> None:
    def thing(name: str, support: str) -> Truth:
        return Truth(
            object=name,
            kind="cup",
            time_s=0.0,
            point_m=(0.0, 0.0, 0.0),
            place="kitchen",
            support=support,
            held_by=None,
            settled=True,
        )

    things = {"cup": thing("cup", "drawer_1"), "mug": thing("mug", "anna")}
    ground_truth = GroundTruth(
        things,
        {},
        {},
        parts={"drawer_1": "cabinet"},
        state_of=lambda subject, state: {("cup", "level"): 2.0}.get((subject, state)),
    )
    names = ("cup", "mug", "drawer_1", "cabinet", "anna", "kitchen")

    def holds(text: str) -> bool:
        return ground_truth.satisfies(parse_expectation(text, names, "here"))

    assert holds("cup in drawer_1")
    assert holds("cup in cabinet")
    assert holds("cup in kitchen")
    assert not holds("mug in cabinet")
    assert holds("mug with anna")
    assert holds("level(cup) is 2")
    assert not holds("level(cup) is 3")
    assert not holds("clean(cup) is false"), "nobody knows"
    assert holds("2 of cup, mug in kitchen")
    assert not holds("2 of cup, mug in cabinet")
    with pytest.raises(BadFile, match="nothing called 'spoon'"):
        parse_expectation("2 of cup, spoon in kitchen", names, "here")
