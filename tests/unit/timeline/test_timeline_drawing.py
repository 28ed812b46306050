"""The clock, the layout of the task graph, trails, lanes and the palette, each by its laws."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from fleet.timeline.clock import Clock, wall_of
from fleet.timeline.drawing import event_log
from fleet.timeline.drawing.blueprint import (
    ABREAST,
    AXIS_SHARE,
    COLUMNS,
    LANE_SHARE,
    MOST_SHARE,
    chart_share,
    lane_columns,
)
from fleet.timeline.drawing.gantt import Bar, Lane, Lanes, call_text
from fleet.timeline.drawing.palette import Palette
from fleet.timeline.drawing.sink import FARTHEST_S, Sink, open_stream
from fleet.timeline.drawing.task_graph.layout import WIDEST_PX, Node, layout
from fleet.timeline.drawing.text import DRAWN, drawable
from fleet.timeline.drawing.trails import CORNERS, Trail
from fleet.timeline.drawing.utilisation import Utilisation
from fleet.timeline.drawing.world import World
from fleet.timeline.reader import rows
from keyexpr_schema.payloads.programs import ProgramCall, ProgramTrace
from keyexpr_schema.payloads.robots import RobotActivity, RobotSpec, RobotState
from keyexpr_schema.payloads.tasks import Report, ReportState, TaskState
from tests.support.reached import Reached, reaches
from tests.support.timeline_mission import STEPS, record


def test_a_zenoh_timestamp_gives_its_wall_time() -> None:
    assert wall_of(f"{1_760_000_000 * 2**32 + 2**31}/ab12") == 1_760_000_000.5
    assert wall_of("") is None
    assert wall_of("yesterday/1") is None
    assert wall_of("²/1") is None


def test_the_clock_places_a_value_between_its_neighbours() -> None:
    clock = Clock()
    assert clock.fleet_at(5.0) == 0.0
    assert clock.wall_at(5.0) is None
    clock.tick(100.0, 10.0)
    clock.tick(102.0, 30.0)
    assert clock.fleet_at(101.0) == 20.0
    assert clock.wall_at(20.0) == 101.0
    assert clock.fleet_at(99.0) == 10.0
    assert clock.fleet_at(500.0) == 30.0  # a clock that is published and stands still
    clock.tick(103.0, 1.0)  # a new run
    assert clock.now_s == 1.0
    assert clock.fleet_at(101.0) == 1.0


def test_ticks_that_lag_behind_what_robots_say_are_no_new_run() -> None:
    clock = Clock()
    clock.tick(100.0, 10.0)
    clock.anchor(100.5, 25.0)  # a fast simulation: a report of what comes after the next tick
    clock.tick(100.6, 12.0)
    assert (clock.runs, clock.now_s) == (0, 25.0)
    clock.tick(101.0, 1.0)
    assert (clock.runs, clock.now_s) == (1, 1.0)


def test_what_was_stored_of_an_earlier_run_does_not_count() -> None:
    clock = Clock()
    clock.anchor(100.0, 500.0)
    clock.tick(200.0, 3.0)
    assert (clock.now_s, clock.fleet_at(150.0)) == (3.0, 3.0)


def test_without_a_published_clock_time_goes_on() -> None:
    clock = Clock()
    clock.anchor(100.0, 10.0)
    assert clock.fleet_at(104.0) == 14.0


@given(st.lists(st.tuples(st.floats(0, 1e6), st.floats(0, 1e6)), max_size=40))
def test_the_clock_never_runs_backwards_whatever_it_learns(
    pairs: list[tuple[float, float]],
) -> None:
    clock = Clock()
    for wall_s, fleet_s in pairs:
        clock.anchor(wall_s, fleet_s)
    known = [clock.fleet_at(wall_s) for wall_s in sorted(wall for wall, _ in pairs)]
    assert all(a <= b + 1e-6 for a, b in pairwise(known))


def nodes() -> st.SearchStrategy[list[Node]]:
    names = [f"t{i}" for i in range(12)]
    node = st.tuples(
        st.sampled_from(["r1", "r2", "?a1"]),
        st.lists(st.sampled_from([*names, "unknown"]), max_size=4),
        st.text(max_size=20),
    )
    return st.builds(
        lambda many, ordered: [
            Node(
                task=name,
                label=f"{text}\nx",
                state=TaskState.WAITING,
                lane=lane,
                after=tuple(a for a in after if not ordered or a in (*names[:number], "unknown")),
            )
            for number, (name, (lane, after, text)) in enumerate(zip(names, many, strict=False))
        ],
        st.lists(node, max_size=12),
        st.booleans(),
    )


@reaches("dependencies", "a circle")
@given(nodes())
def test_no_two_nodes_overlap_and_dependencies_point_down(
    reached: Reached, drawn: list[Node]
) -> None:
    places = layout(drawn)
    assert set(places) == {node.task for node in drawn}
    width = {n.task: 7.0 * max(map(len, n.label.split("\n"))) for n in drawn}
    for i, a in enumerate(drawn):
        for b in drawn[:i]:
            (ax, ay), (bx, by) = places[a.task], places[b.task]
            apart = abs(ax - bx) >= (width[a.task] + width[b.task]) / 2
            assert apart or abs(ay - by) >= 40.0
    if all(
        int(first[1:]) < int(n.task[1:]) for n in drawn for first in n.after if first != "unknown"
    ):
        for node in drawn:
            for first in node.after:
                if first in places:
                    reached["dependencies"] += 1
                    assert places[first][1] < places[node.task][1]
    else:
        reached["a circle"] += 1


def test_of_many_robots_those_that_wait_for_nobody_stand_in_rows() -> None:
    drawn = [
        Node(task=f"t{n}", label="x" * 20, state=TaskState.WAITING, lane=f"r{n // 3}",
             after=(f"t{n - 1}",) if n % 3 else ())
        for n in range(60)
    ]  # fmt: skip
    places = layout(drawn)
    assert max(x for x, _ in places.values()) <= WIDEST_PX
    assert len({y for _, y in places.values()}) == 12  # four rows of robots with three tasks each


@settings(deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(0, 100), st.one_of(st.none(), st.floats(0, 50))),
        max_size=8,
    ),
    st.floats(1, 100),
)
def test_busy_time_is_never_counted_twice(
    spans: list[tuple[float, float | None]], until_s: float
) -> None:
    lane = Lane("/robots/r")
    for i, (start, length) in enumerate(spans):
        end = None if length is None else start + length
        lane.bars[str(i)] = Bar(str(i), "", (0, 0, 0, 0), start, end)
    steps = 400
    samples = [(k + 0.5) * until_s / steps for k in range(steps)]
    counted = sum(lane.at(at) is not None for at in samples) * until_s / steps
    half, whole = lane.busy_s(0.0, [until_s / 2, until_s])
    assert whole == pytest.approx(counted, abs=2 * (len(spans) + 1) * until_s / steps)
    counted = sum(lane.at(at) is not None for at in samples[: steps // 2]) * until_s / steps
    assert half == pytest.approx(counted, abs=2 * (len(spans) + 1) * until_s / steps)


def test_a_task_that_starts_as_another_ends_is_not_hidden(tmp_path: Path) -> None:
    """The planner's word on the next task can come before its word on the last one."""
    path = tmp_path / "lanes.rrd"
    stream = open_stream(path, "test")
    clock = Clock()
    sink = Sink(stream, clock)
    lanes = Lanes(sink, Palette())
    first, second = STEPS[0], STEPS[1]
    lanes.record(record(first, TaskState.RUNNING, started_s=0.0), 0.0)
    lanes.record(record(second, TaskState.RUNNING, started_s=15.0), 15.1)
    lanes.record(record(first, TaskState.SUCCEEDED, started_s=0.0, ended_s=15.0), 15.2)
    lanes.flush()
    use = Utilisation(sink, lanes, Palette())
    use.advance(20.0)
    sink.flush()
    stream.disconnect()
    held = {row.sim_s: row.value[0] for row in rows(path, "/robots/hsr", "state")}
    assert held == {0.0: "p1/t1#1", 15.0: "p1/t2#1"}
    busy = {
        row.sim_s: row.value[0] for row in rows(path, "/fleet/utilisation/all/fleet", "scalars")
    }
    assert busy[19.0] == 1.0
    assert 0.0 not in busy


def test_a_bar_is_not_hidden_by_what_was_shown_before_it_was_known(tmp_path: Path) -> None:
    path = tmp_path / "lanes.rrd"
    stream = open_stream(path, "test")
    sink = Sink(stream, Clock())
    lanes = Lanes(sink, Palette())
    lanes.show_empty(lanes.robot("hsr"), 0.2)
    lanes.record(record(STEPS[0], TaskState.RUNNING, started_s=0.0), 0.3)
    lanes.record(record(STEPS[0], TaskState.SUCCEEDED, started_s=0.0, ended_s=15.0), 15.2)
    sink.flush()
    stream.disconnect()
    held = {row.sim_s: row.value[0] for row in rows(path, "/robots/hsr", "state")}
    assert held == {0.0: "p1/t1#1", 0.2: "p1/t1#1", 15.0: ""}


def test_a_trail_has_a_corner_where_the_way_turns_and_no_end_of_them(tmp_path: Path) -> None:
    path = tmp_path / "trail.rrd"
    stream = open_stream(path, "test")
    sink = Sink(stream, Clock())
    straight, zigzag = Trail("/a", (1, 2, 3, 255), 0.1), Trail("/b", (1, 2, 3, 255), 0.1)
    for i in range(100):
        straight.visit(sink, (0.2 * min(i, 50), 0.2 * max(0, i - 50), 0.0), 0.1 * i, 0.1 * i)
    for i in range(CORNERS + 50):
        zigzag.visit(sink, (0.2 * i, 0.5 * (i % 2), 0.0), 0.1 * i, 0.1 * i)
    sink.flush()
    stream.disconnect()
    corner = rows(path, "/a", "strips")[-1].value[0]
    assert [tuple(round(x, 2) for x in point[:2]) for point in corner] == [
        (0, 0),
        (10, 0),
        (10, 9.8),
    ]
    assert len(rows(path, "/b", "strips")[-1].value[0]) == CORNERS


@pytest.mark.parametrize("count", [0, 1, 2, 7, 8, 10, 20, 50, 52])
def test_all_lanes_fit_into_the_chart(count: int) -> None:
    lanes = [f"/robots/r{number}" for number in range(count)]
    columns = lane_columns(lanes)
    assert [lane for column in columns for lane in column] == lanes
    assert len(columns) == (1 if count <= ABREAST else min(COLUMNS, -(-count // ABREAST)))
    most = max(map(len, columns))
    assert chart_share(most) >= AXIS_SHARE + LANE_SHARE * most
    assert chart_share(most) <= MOST_SHARE


def test_a_call_names_neither_its_robot_nor_actors() -> None:
    args = {"robot": "hsr", "object": "cup_1", "carrier": "?a2"}
    assert call_text("place_on_robot", args, "hsr") == "place_on_robot cup_1"


def test_colours_stay_and_the_first_ones_differ() -> None:
    palette = Palette()
    first = [palette.robot(f"r{i}") for i in range(8)]
    assert len(set(first)) == 8
    assert [palette.robot(f"r{i}") for i in range(20)][:8] == first
    skills = [
        palette.skill(s) for s in ("navigate", "search", "pick", "place", "place_on_robot", "fly")
    ]
    assert len(set(skills)) == 6


@given(st.text())
def test_every_text_becomes_one_that_the_viewer_can_draw(text: str) -> None:
    assert DRAWN.issuperset(drawable(text))


def test_text_that_can_be_drawn_stays_and_other_text_becomes_plainer() -> None:
    fine = "Bring die Tasse in den Flur, “schön”; Ελλάς, кухня ✓"
    assert drawable(fine) == fine
    assert drawable("scho\u0308n ﬁne\tcup ☕杯\u200b") == "schön fine cup ??"


def test_a_label_that_is_drawn_anew_keeps_what_the_robot_does(tmp_path: Path) -> None:
    path = tmp_path / "label.rrd"
    stream = open_stream(path, "test")
    sink = Sink(stream, Clock())
    world = World(sink, Palette())
    world.robot_label("hsr", "pick cup_1", 1.0, None)  # nobody knows yet where it is
    pose = (1.0, 2.0, 0.0)
    here = RobotState(robot="hsr", incarnation="i", activity=RobotActivity.BUSY, pose_m_rad=pose)
    world.state(here, 2.0, 2.0)
    world.robot(RobotSpec(robot="hsr", model="hsr", label="Rosie", skills=(), capabilities={}))
    world.robot(RobotSpec(robot="hsr", model="hsr", label="HSR", skills=(), capabilities={}))
    sink.flush()
    stream.disconnect()
    labels = [row.value for row in rows(path, "/world/robots/hsr/label", "labels")]
    assert {text for (text,) in labels} == {"hsr: pick cup_1", "hsr (Rosie): pick cup_1"}


def test_each_call_of_a_program_is_told_once_where_it_ended() -> None:
    asked = ProgramCall(
        number=1, name="ask", args={"relation": "at", "subject": "c"}, line=2, ended_s=1.0
    )
    failed = ProgramCall(
        number=2, name="pick", args={"object": "c"}, line=3, reason="it slipped", ended_s=5.0
    )
    base = Report(
        robot="hsr",
        plan="p",
        revision=1,
        task="t1",
        attempt=1,
        epoch=1,
        incarnation="i",
        state=ReportState.STARTED,
    )
    before = replace(base, program=ProgramTrace(code="…", calls=(asked,)))
    now = replace(base, program=ProgramTrace(code="…", calls=(asked, failed)))
    assert list(event_log.calls(before, None)) == [
        (1.0, (event_log.INFO, "hsr: program line 2: ask(at, c) = unknown"))
    ]
    assert list(event_log.calls(now, before)) == [
        (5.0, (event_log.WARN, "hsr: program line 3: pick(c) failed: it slipped"))
    ]
    assert list(event_log.calls(base, None)) == []


def test_that_a_worker_begins_is_a_warning_only_where_one_was_that_had_not_ended() -> None:
    def state(run: str, activity: RobotActivity) -> RobotState:
        return RobotState(robot="hsr", incarnation=run, activity=activity)

    begins = state("b", RobotActivity.RECOVERING)
    assert list(event_log.robot_state(begins, None)) == [(event_log.INFO, "hsr is recovering")]
    for before, level in ((RobotActivity.STOPPED, "INFO"), (RobotActivity.BUSY, "WARN")):
        told = list(event_log.robot_state(begins, state("a", before)))
        assert told == [(level, "hsr's worker started anew"), (level, "hsr is recovering")]


@pytest.mark.parametrize("time_s", [1e11, -1e11, 1e300])
def test_a_time_that_no_recording_can_have_is_drawn_as_far_away_as_it_can_be(
    time_s: float, tmp_path: Path
) -> None:
    out = tmp_path / "r.rrd"
    stream = open_stream(out, "test")
    sink = Sink(stream, Clock())
    sink.log("said", rr.TextLog("far"), time_s, 1e11)
    sink.row("drawn", rr.TextLog, time_s, -1e11, text="far, too")
    sink.flush()
    stream.disconnect()
    found = [row.sim_s for path in ("/said", "/drawn") for row in rows(out, path, "TextLog:text")]
    assert found == [max(-FARTHEST_S, min(FARTHEST_S, time_s))] * 2
