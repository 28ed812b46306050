"""A scripted mission goes in, a recording comes out, and what is in it is read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest

from fleet.timeline.drawing import event_log
from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.errors import UnreadableRecording, UnwritableRecording
from fleet.timeline.reader import rows, summary
from fleet.timeline.recorder import Recorder
from keyexpr_schema import keyspace as keys
from keyexpr_schema.payloads.plans import PlanAddress
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.simulation import Frame, Frames, SimAddress, SimClock
from keyexpr_schema.payloads.system import UndecodableAddress, UndecodableValue
from keyexpr_schema.payloads.tasks import (
    Order,
    Report,
    ReportAddress,
    ReportState,
    TaskAddress,
    TaskState,
)
from keyexpr_schema.payloads.world import Fact, FactAddress
from tests.support.timeline_mission import (
    END_S,
    STEPS,
    WALL_S,
    Put,
    mission,
    plan,
    put,
    record,
    script,
    written,
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("timeline") / "mission.rrd", mission())


def bars(path: Path, robot: str) -> list[tuple[float, str]]:
    """What holds from when on in a robot's lane: of rows at one time the last one counts."""
    found: dict[float, str] = {}
    for row in rows(path, f"/robots/{robot}", "state"):
        assert row.sim_s is not None
        found[round(row.sim_s, 3)] = row.value[0]
    return sorted(found.items())


def said(path: Path, topic: str) -> list[tuple[float | None, str]]:
    return [(row.sim_s, row.value[0]) for row in rows(path, f"/fleet/log/{topic}", "text")]


def test_both_timelines_and_the_whole_span_are_there(recording: Path) -> None:
    found = summary(recording)
    assert found.timelines == {"sim_time", "wall_time"}
    assert found.sim_span_s is not None
    assert found.sim_span_s[0] == 0.0
    assert END_S - 5.0 < found.sim_span_s[1] <= END_S
    assert found.size_bytes > 0


def test_a_lane_has_a_bar_for_each_task_at_its_simulated_times(recording: Path) -> None:
    for robot in ("hsr", "locobot"):
        wanted: dict[float, str] = {}
        for step in STEPS:
            if step.robot == robot:
                wanted.setdefault(float(step.end_s), "")
                wanted[float(step.start_s)] = f"p1/{step.task}#1"
        lane = bars(recording, robot)
        assert [(at, state) for at, state in lane if at >= 2.0] == sorted(wanted.items())
        assert all(state == "" for at, state in lane if at < 2.0)


def test_bars_are_coloured_by_skill_and_labelled_with_the_call(recording: Path) -> None:
    values = rows(recording, "/robots/hsr", "values")[-1].value
    labels = rows(recording, "/robots/hsr", "labels")[-1].value
    colours = rows(recording, "/robots/hsr", "colors")[-1].value
    mine = [step for step in STEPS if step.robot == "hsr"]
    assert values == [f"p1/{step.task}#1" for step in mine]
    assert labels[2] == "pick cup_1"
    by_skill = {step.skill: colour for step, colour in zip(mine, colours, strict=True)}
    assert len(set(by_skill.values())) == len(by_skill)
    assert all(by_skill[s.skill] == c for s, c in zip(mine, colours, strict=True))


def test_every_body_is_where_its_frames_said(recording: Path) -> None:
    truth: dict[str, dict[float, Any]] = {}
    for change in mission():
        if change.key is keys.SIM_FRAMES:
            (frame,) = change.value.frames
            for body, (point, _) in frame.poses.items():
                truth.setdefault(body, {})[round(frame.time_s, 3)] = point
    for body, owner in (("hsr/base", "hsr"), ("locobot/base", "locobot"), ("cup_1", "cup_1")):
        path = f"/world/bodies/{owner}/{body.replace('/', chr(92) + '/')}"
        logged = rows(recording, path, "translation")
        assert len(logged) > 50
        for row in logged:
            assert row.sim_s is not None
            assert row.value[0] == pytest.approx(truth[body][round(row.sim_s, 3)], abs=1e-4)
        last = truth[body][max(truth[body])]
        assert logged[-1].value[0] == pytest.approx(last, abs=1e-3)


def test_the_room_the_places_and_the_trails_are_drawn(recording: Path) -> None:
    found = summary(recording)
    assert found.entities["/world/room/walls/box"].static
    assert found.entities["/world/bodies/hsr/hsr\\/arm/capsule"].static
    names = {rows(recording, f"/world/places/{place}/name", "labels")[0].value[0] for place in
             ("kitchen", "hallway", "living_room")}  # fmt: skip
    assert names == {"Kitchen", "Hallway", "Living room"}
    for owner in ("hsr", "locobot", "cup_1", "cup_2"):
        assert found.entities[f"/world/trails/{owner}"].rows > 5
    trail = rows(recording, "/world/trails/hsr", "strips")[-1].value[0]
    assert len(trail) < 40  # straight stretches need no corners
    robots = {rows(recording, f"/world/trails/{robot}", "colors")[-1].value[0] for robot in
              ("hsr", "locobot")}  # fmt: skip
    assert len(robots) == 2


def test_the_graph_has_every_task_its_edges_and_its_states_over_time(recording: Path) -> None:
    ids = rows(recording, "/fleet/dag/p1/1", "node_ids")
    assert ids[-1].value[0] == "p1 r1"
    assert sorted(ids[-1].value[1:]) == [step.task for step in STEPS]
    edges = {
        (e["first"], e["second"]) for e in rows(recording, "/fleet/dag/p1/1", "edges")[-1].value
    }
    assert edges == {(first, step.task) for step in STEPS for first in step.after}
    labels = rows(recording, "/fleet/dag/p1/1", "labels")

    def states(at_s: float) -> list[str]:
        row = [one for one in labels if one.sim_s is not None and one.sim_s <= at_s][-1]
        return [label.rsplit(" · ", 1)[1] for label in row.value[1:]]

    assert [label.value[0] for label in labels][-1] == "p1 · succeeded"
    assert set(states(1.15)) == {"waiting"}
    assert sorted(states(50.0)) == ["running"] * 2 + ["succeeded"] * 5 + ["waiting"] * 2
    assert set(states(END_S)) == {"succeeded"}


def test_each_revision_of_a_plan_has_a_graph_of_its_own(tmp_path: Path) -> None:
    """What is done stays in the revision that it was done in; what goes on moves into the next."""

    def stands(number: int, state: TaskState, at_s: float, revision: int = 1) -> Put:
        step = STEPS[number]
        row = msgspec.structs.replace(record(step, state, started_s=at_s), revision=revision)
        return put(keys.TASK_RECORD, TaskAddress(plan="p1", task=step.task), row, at_s)

    again = msgspec.structs.replace(plan(), revision=2, tasks=plan().tasks[1:4])
    changes = [
        put(keys.PLAN_SPEC, PlanAddress(plan="p1"), plan(), 1.0),
        stands(0, TaskState.SUCCEEDED, 2.0),
        stands(1, TaskState.RUNNING, 3.0),
        stands(4, TaskState.RUNNING, 4.0),
        put(keys.PLAN_SPEC, PlanAddress(plan="p1"), again, 10.0),
        stands(4, TaskState.CANCELLED, 11.0),
        stands(1, TaskState.SUCCEEDED, 12.0),
        stands(2, TaskState.RUNNING, 13.0, 2),
    ]
    path = written(tmp_path / "revisions.rrd", changes)
    first, second = (rows(path, f"/fleet/dag/p1/{n}", "labels")[-1].value for n in (1, 2))
    assert first[0] == "p1 · revision 1 · replaced"
    assert [label.split(":")[0] for label in first[1:]] == ["✔ t1", "∅ t5"]
    assert second[0] == "p1 · revision 2"
    assert sorted(label.split(":")[0] for label in second[1:]) == ["… t4", "▶ t3", "✔ t2"]
    positions = [rows(path, f"/fleet/dag/p1/{n}", "positions")[-1].value for n in (1, 2)]
    assert max(x for x, _ in positions[0]) + 100.0 < min(x for x, _ in positions[1])


def test_utilisation_is_the_busy_part_of_the_time_since_work_began(recording: Path) -> None:
    def value(name: str, at_s: float) -> float:
        found = {row.sim_s: row.value[0] for row in rows(recording, name, "scalars")}
        return float(found[at_s])

    assert value("/fleet/utilisation/robots/locobot", 13.0) == pytest.approx(1.0)
    busy = 11 + 9
    assert value("/fleet/utilisation/robots/locobot", 85.0) == pytest.approx(busy / 83)
    assert value("/fleet/utilisation/robots/hsr", 85.0) == pytest.approx(1.0)
    assert value("/fleet/utilisation/all/fleet", 85.0) == pytest.approx((1 + busy / 83) / 2)


def test_the_log_tells_goals_plans_orders_and_tries_in_sentences(recording: Path) -> None:
    goals = [text for _, text in said(recording, "goals")]
    assert goals[0] == "goal g1: “Bring the first cup to the hallway.”"
    assert "goal g1 is planned; it means at(cup_1) = hallway" in goals
    assert (54.3, "goal g1 is reached") in [
        (round(t or 0, 2), s) for t, s in said(recording, "goals")
    ]
    reports = [text for _, text in said(recording, "reports")]
    assert "hsr: pick cup_1 (t3), try 1 failed: the hand closed on nothing" in reports
    assert "hsr: pick cup_1 (t3) succeeded at try 2" in reports
    orders = [text for _, text in said(recording, "orders")]
    assert orders[:2] == ["hsr shall navigate kitchen (t1)", "locobot shall navigate kitchen (t4)"]
    assert len(orders) == len(STEPS)
    plans = [text for _, text in said(recording, "plans")]
    assert "plan p1 is succeeded" in plans
    assert "plan p1 allocates a1 → hsr, a2 → locobot" in plans


def test_wall_time_follows_from_the_timestamps(recording: Path) -> None:
    from rerun.chunk import RrdReader

    seen = 0
    with pytest.warns(match="no footer"):
        reader = RrdReader(recording)
    for chunk in reader.stream():
        if str(chunk.entity_path).startswith(("/robots", "/fleet/utilisation", "/world/bodies")):
            batch = chunk.to_record_batch()
            if chunk.is_static:
                continue
            sim = batch.column("sim_time").cast("int64").to_pylist()
            wall = batch.column("wall_time").cast("int64").to_pylist()
            for a, b in zip(sim, wall, strict=True):
                assert b / 1e9 - WALL_S == pytest.approx(a / 1e9, abs=0.2)
                seen += 1
    assert seen > 500


def test_a_recorder_that_starts_late_puts_the_past_where_it_happened(tmp_path: Path) -> None:
    """Only the last value of each key is stored, and they come in any order."""
    stored: dict[tuple[str, Any], Put] = {}
    for change in script():
        stored[(change.key.name, change.address)] = change
    clock = SimClock(time_s=END_S, wall_time_s=WALL_S + END_S, speed=1.0)
    late = [put(keys.SIM_CLOCK, SimAddress(), clock, END_S), *reversed(list(stored.values()))]
    path = written(tmp_path / "late.rrd", late, backlog=True)
    lane = dict(bars(path, "hsr"))
    for step in STEPS:
        if step.robot == "hsr":
            assert lane[float(step.start_s)] == f"p1/{step.task}#1"
    assert lane[85.0] == ""
    orders = {text: at for at, text in said(path, "orders")}
    assert orders["hsr shall place cup_2 living_room (t9)"] == pytest.approx(75.8, abs=0.5)
    found = {r.sim_s: r.value[0] for r in rows(path, "/fleet/utilisation/all/fleet", "scalars")}
    assert found[85.0] == pytest.approx((1 + 20 / 83) / 2)


def test_a_clock_that_lags_behind_what_robots_say_loses_nothing(tmp_path: Path) -> None:
    """A fast simulation ticks seldom: what was counted since the first task is counted on."""
    late = {keys.SIM_CLOCK, keys.SIM_FRAMES}

    def comes(change: Put) -> int:
        stamp = int(change.timestamp.split("/")[0])
        return stamp + (5 << 32 if change.key in late else 0)

    path = tmp_path / "lagging.rrd"
    recorder = Recorder(open_stream(path, "test"))
    for change in sorted(mission(), key=comes):
        recorder.record(change)
        recorder.flush()
    recorder.close()
    found = {r.sim_s: r.value[0] for r in rows(path, "/fleet/utilisation/all/fleet", "scalars")}
    assert found[85.0] == pytest.approx((1 + 20 / 83) / 2)
    assert bars(path, "hsr")[1:3] == [(2.0, "p1/t1#1"), (15.0, "p1/t2#1")]


def test_all_is_in_its_place_from_the_beginning(tmp_path: Path) -> None:
    """Frames come before the scene says which bodies they are of, or only from some time on."""
    changes = mission()
    (shown,) = (change for change in changes if change.key is keys.SIM_SCENE)
    missed = [c for c in changes if c is not shown and not (
        c.key is keys.SIM_FRAMES and c.value.frames[0].time_s < 1.0
    )]  # fmt: skip
    later = next(n for n, c in enumerate(missed) if c.key is keys.SIM_FRAMES) + 20
    path = written(tmp_path / "late.rrd", [*missed[:later], shown, *missed[later:]])
    found = summary(path)
    moving = {f"/world/bodies/{body.owner}/{body.body.replace('/', chr(92) + '/')}": body
              for body in shown.value.bodies if body.owner is not None}  # fmt: skip
    assert moving.keys() <= found.entities.keys()
    assert not any(name.startswith("/world/bodies/world") for name in found.entities)
    for name in moving:
        first = rows(path, name, "translation")[0]
        assert first.sim_s == 0.0
        assert first.value[0] != [0.0, 0.0, 0.0]


def test_a_normal_end_is_no_warning(recording: Path) -> None:
    step = STEPS[0]
    said: dict[str, Any] = {"robot": "hsr", "plan": "p1", "revision": 1, "task": "t1", "attempt": 1}
    attempt = Report(**said, epoch=1, incarnation="i", state=ReportState.CANCELLED)
    order = Order(**said, epoch=1, skill="search", args={}, deadline_s=9.0, cancelled=True)
    over = RobotState(robot="hsr", incarnation="i", activity=RobotActivity.STOPPED)
    lines = [
        *event_log.report(attempt, None, "search"),
        *event_log.order(order, None),
        *event_log.task_record(record(step, TaskState.CANCELLED), None),
        *event_log.robot_state(over, None),
    ]
    assert lines and {level for level, _ in lines} == {event_log.INFO}
    failed = msgspec.structs.replace(attempt, state=ReportState.FAILED, reason="it slipped")
    ((level, _),) = event_log.report(failed, None, "search")
    assert level == event_log.ERROR
    levels = {row.value[0] for name in summary(recording).entities if "/fleet/log" in name
              for row in rows(recording, name, "level")}  # fmt: skip
    assert event_log.ERROR not in levels


def test_values_that_are_known_already_change_nothing(tmp_path: Path) -> None:
    once = written(tmp_path / "once.rrd", script())
    again = written(tmp_path / "again.rrd", [*script(), *script()[-40:]])
    for topic in ("goals", "orders", "plans"):
        texts = [text for _, text in said(once, topic)]
        assert texts == [text for _, text in said(again, topic)][: len(texts)]


def test_odd_orders_are_drawn_as_far_as_they_can_be(tmp_path: Path) -> None:
    step = STEPS[0]
    task = TaskAddress(plan="p1", task="t1")

    def books(state: TaskState, at_s: float, **more: Any) -> Put:
        return put(keys.TASK_RECORD, task, record(step, state, **more), at_s)

    other = msgspec.structs.replace(
        record(step, TaskState.RUNNING, attempt=2, started_s=20.0), robot="stranger"
    )
    smaller = msgspec.structs.replace(plan(), revision=2, tasks=plan().tasks[3:])
    looped = msgspec.structs.replace(
        plan(),
        plan="p2",
        tasks=tuple(
            msgspec.structs.replace(t, after=("t1", "t9", "nowhere")) for t in plan().tasks
        ),
    )
    stray = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    restarted = SimClock(time_s=2.0, wall_time_s=WALL_S + 39, speed=None)
    changes = [
        books(TaskState.RUNNING, 5.0, started_s=5.0),  # before plan, robot and scene
        books(TaskState.FAILED, 9.0, started_s=5.0, ended_s=9.0, reason="the door is shut"),
        put(keys.PLAN_SPEC, PlanAddress(plan="p1"), plan(), 10.0),
        put(keys.TASK_RECORD, task, other, 20.0),  # a robot that nobody registered
        put(keys.PLAN_SPEC, PlanAddress(plan="p1"), smaller, 30.0),  # t1 is wanted no more
        put(keys.TASK_RECORD, task, None, 31.0),
        put(keys.TASK_RECORD, task, None, 31.5),
        put(keys.PLAN_SPEC, PlanAddress(plan="p2"), looped, 32.0),
        put(keys.PLAN_STATUS, PlanAddress(plan="p1"), None, 33.0),
        put(
            keys.SIM_FRAMES,
            SimAddress(),
            Frames(frames=(Frame(time_s=34.0, poses={"x/y": stray}),)),
            34.0,
        ),
        put(
            keys.ROBOT_STATE,
            RobotAddress(robot="real"),
            RobotState(
                robot="real",
                incarnation="i",
                activity=RobotActivity.RECOVERING,
                pose_m_rad=(1.0, 2.0, 0.5),
                time_s=35.0,
            ),
            35.0,
        ),
        put(
            keys.REPORT,
            ReportAddress(robot="real", plan="p9", task="t9", attempt=3),
            Report(
                robot="real",
                plan="p9",
                revision=4,
                task="t9",
                attempt=3,
                epoch=1,
                incarnation="i",
                state=ReportState.REFUSED,
                reason="an older order",
            ),
            36.0,
        ),
        put(
            keys.FACT,
            FactAddress(subject="cup_1", relation="at"),
            Fact(subject="cup_1", relation="at", value=None, source="hsr"),
            37.0,
        ),
        put(
            keys.UNDECODABLE,
            UndecodableAddress(component="planner", digest="d"),
            UndecodableValue(component="planner", keyexpr="goals/x/spec", reason="it is no goal"),
            38.0,
        ),
        put(keys.SIM_CLOCK, SimAddress(), restarted, 39.0),
        Put(keys.GOAL_SPEC, keys.GOAL_SPEC.address("g1"), None, ""),
    ]  # fmt: skip
    path = written(tmp_path / "odd.rrd", changes)
    assert bars(path, "hsr") == [(5.0, "p1/t1#1"), (9.0, "")]
    assert rows(path, "/robots/hsr", "labels")[-1].value == ["✗ navigate kitchen"]
    assert bars(path, "stranger") == [(20.0, "p1/t1#2"), (31.0, "")]
    assert "t1" not in rows(path, "/fleet/dag/p1/2", "node_ids")[-1].value
    assert rows(path, "/fleet/dag/p1/1", "is_recursive")[-1].sim_s == 31.0
    drawn = rows(path, "/fleet/dag/p2/1", "node_ids")[-1].value
    assert sorted(drawn[1:]) == [s.task for s in STEPS]
    assert summary(path).entities["/world/robots/real"].rows == 1
    assert [t for _, t in said(path, "reports")] == ["real: t9 refused: an older order"]
    assert [t for _, t in said(path, "rejects")] == [
        "planner could not read goals/x/spec: it is no goal"
    ]
    assert [t for _, t in said(path, "facts")] == ["hsr says at(cup_1) = unknown"]


def test_what_was_flushed_outlives_a_recorder_that_never_closed(tmp_path: Path) -> None:
    path = tmp_path / "open.rrd"
    recorder = Recorder(open_stream(path, "test"))
    for change in mission(0.5):
        recorder.record(change)
    recorder.flush()
    copy = tmp_path / "killed.rrd"
    copy.write_bytes(path.read_bytes())  # what a SIGKILL would leave
    recorder.close()
    assert bars(copy, "hsr") == bars(path, "hsr")
    assert len(rows(copy, "/fleet/dag/p1/1", "node_ids")) > 10


def test_bad_files_are_told_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UnreadableRecording, match="there is no recording at"):
        summary(tmp_path / "none.rrd")
    (tmp_path / "text.rrd").write_text("this is no recording, but long enough to look at")
    with pytest.raises(UnreadableRecording, match="not a readable Rerun recording"):
        summary(tmp_path / "text.rrd")
    (tmp_path / "file").write_text("")
    with pytest.raises(UnwritableRecording, match="cannot record to"):
        open_stream(tmp_path / "file" / "x.rrd", "test")
    with pytest.raises(
        UnwritableRecording, match=r"cannot record to .*: it is a folder and no file"
    ):
        open_stream(tmp_path, "test")
