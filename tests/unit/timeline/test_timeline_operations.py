"""Stops, pauses, drains and closed zones are drawn, and so are charge and programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.reader import rows, summary
from fleet.timeline.recorder import Recorder
from keyexpr_schema import keyspace as keys
from keyexpr_schema.payloads.closures import Closure, ClosureAddress
from keyexpr_schema.payloads.holds import Hold, HoldAddress, HoldKind
from keyexpr_schema.payloads.programs import ProgramCall, ProgramTrace
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.simulation import SimAddress, SimClock
from keyexpr_schema.payloads.stops import Stop, StopAddress, StopRelease, StopReleaseAddress
from keyexpr_schema.payloads.tasks import Report, ReportAddress, ReportState
from tests.support.timeline_mission import WALL_S, Put, mission, put, written


def lanes(path: Path, robot: str) -> list[tuple[float, str]]:
    """The bars of a robot by label, and when each begins; nothing between them is `""`."""
    looks = rows(path, f"/robots/{robot}", "labels")[-1].value
    names = rows(path, f"/robots/{robot}", "values")[-1].value
    label = {"": "", **dict(zip(names, looks, strict=True))}
    held: dict[float, str] = {}
    for row in rows(path, f"/robots/{robot}", "state"):
        held[round(row.sim_s or 0.0, 1)] = label[row.value[0]]
    found: list[tuple[float, str]] = []
    for at_s, text in sorted(held.items()):
        if not found or found[-1][1] != text:
            found.append((at_s, text))
    return found


def said(path: Path, topic: str) -> list[tuple[str, str]]:
    texts = rows(path, f"/fleet/log/{topic}", "text")
    levels = rows(path, f"/fleet/log/{topic}", "level")
    return [(level.value[0], text.value[0]) for level, text in zip(levels, texts, strict=True)]


def in_order(changes: list[Put]) -> list[Put]:
    return sorted(changes, key=lambda change: int(change.timestamp.split("/")[0]))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mission, with a stop while the hsr picks, a drain of the locobot when it has nothing more
    to do, and a pause of the whole fleet at the end."""
    stop = Stop(stop="s1", reason="a child came in", by="anna")
    drain = Hold(hold="h1", kind=HoldKind.DRAIN, robots=("locobot",), reason="service")
    pause = Hold(hold="h2", kind=HoldKind.PAUSE, reason="lunch", by="ben")
    release = StopRelease(stop="s1", robot="locobot", by="anna")
    closure = Closure(
        closure="c1", names=("hallway",), region_m=((4.0, 0.0, 6.0, 6.0),), reason="wet floor"
    )
    until = replace(closure, closure="c2", names=("kitchen",), until_s=80.0)
    changes = [
        put(keys.STOP, StopAddress(stop="s1"), stop, 25.0),
        put(keys.STOP_RELEASE, StopReleaseAddress(stop="s1", robot="locobot"), release, 27.0),
        put(keys.STOP, StopAddress(stop="s1"), None, 30.0),
        put(keys.HOLD, HoldAddress(hold="h1"), drain, 50.0),
        put(keys.HOLD, HoldAddress(hold="h2"), pause, 60.0),
        put(keys.HOLD, HoldAddress(hold="h2"), None, 70.0),
        put(keys.HOLD, HoldAddress(hold="h1"), None, 75.0),
        put(keys.CLOSURE, ClosureAddress(closure="c1"), closure, 40.0),
        put(keys.CLOSURE, ClosureAddress(closure="c1"), None, 45.0),
        put(keys.CLOSURE, ClosureAddress(closure="c2"), until, 41.0),
    ]
    path = tmp_path_factory.mktemp("operations") / "operations.rrd"
    return written(path, in_order([*mission(0.5), *changes]))


def test_a_stop_is_seen_before_a_task_and_a_drain_or_pause_where_there_is_none(
    recording: Path,
) -> None:
    hsr = [(at_s, label) for at_s, label in lanes(recording, "hsr") if 20.0 < at_s < 37.0]
    assert [label for _, label in hsr] == [
        "pick cup_1",
        "stopped: a child came in",
        "pick cup_1",
        "place_on_robot cup_1 locobot",
    ]
    assert [at_s for at_s, _ in hsr] == pytest.approx([21.0, 25.0, 30.0, 36.0], abs=0.3)
    assert "paused: lunch" not in [label for _, label in lanes(recording, "hsr")]  # it works on
    other = [(at_s, label) for at_s, label in lanes(recording, "locobot") if at_s > 12.0]
    assert [label for _, label in other] == [
        "",
        "stopped: a child came in",
        "",
        "navigate hallway",
        "drained: service",
        "",
    ]
    begins = [at_s for at_s, _ in other]
    assert begins == pytest.approx([13.0, 25.0, 27.0, 45.0, 54.0, 75.0], abs=0.3)


def test_what_holds_a_robot_back_stands_over_it_and_is_no_work(recording: Path) -> None:
    name = r"/world/bodies/locobot/locobot\/base/label"
    labels = [row.value[0] for row in rows(recording, name, "labels")]
    assert "locobot: stopped: a child came in" in labels
    assert "locobot: drained: service, navigate hallway" in labels
    busy = rows(recording, "/fleet/utilisation/robots/locobot", "scalars")
    shares = {row.sim_s: row.value[0] for row in busy}
    assert shares[85.0] == pytest.approx(20 / 83, abs=0.01)


def test_operations_are_events(recording: Path) -> None:
    assert said(recording, "stops") == [
        ("ERROR", "emergency stop s1 by anna (a child came in): all robots"),
        ("INFO", "locobot is released from emergency stop s1 by anna"),
        ("INFO", "emergency stop s1 is over"),
    ]
    assert said(recording, "holds") == [
        ("WARN", "locobot is drained (service)"),
        ("WARN", "the whole fleet is paused by ben (lunch)"),
        ("INFO", "the whole fleet is paused no more"),
        ("INFO", "locobot is drained no more"),
    ]
    assert said(recording, "closures") == [
        ("WARN", "hallway is closed (wet floor)"),
        ("WARN", "kitchen is closed (wet floor)"),
        ("INFO", "hallway is open again"),
    ]


def test_what_is_closed_is_covered_until_it_is_open_again(recording: Path) -> None:
    for name, begins, ends in (("c1", 40.0, 45.0), ("c2", 41.0, 80.0)):
        path = f"/world/closures/{name}"
        (drawn,) = rows(recording, path, "half_sizes")
        assert drawn.sim_s == pytest.approx(begins, abs=0.6)
        assert drawn.value[0][:2] == [1.0, 3.0]
        (gone,) = rows(recording, path, "is_recursive")
        assert gone.sim_s == pytest.approx(ends, abs=0.6)


def test_charge_is_a_curve_and_stands_over_the_robot(tmp_path: Path) -> None:
    here: dict[str, Any] = {"robot": "real", "incarnation": "i", "activity": RobotActivity.BUSY}
    clock = SimClock(time_s=0.0, wall_time_s=WALL_S, speed=1.0)
    changes = [put(keys.SIM_CLOCK, SimAddress(), clock, 0.0)]
    for number in range(41):
        state = RobotState(
            **here, pose_m_rad=(1.0, 2.0, 0.0), charge=100.0 - number / 4, time_s=float(number)
        )
        changes.append(put(keys.ROBOT_STATE, RobotAddress(robot="real"), state, float(number)))
    path = written(tmp_path / "charge.rrd", in_order(changes))
    curve = [row.value[0] for row in rows(path, "/fleet/charge/real", "scalars")]
    assert curve == [float(percent) for percent in range(100, 89, -1)]
    labels = {row.value[0] for row in rows(path, "/world/robots/real/label", "labels")}
    assert labels == {"real", "real 95 %", "real 90 %"}


def test_the_calls_of_a_program_have_a_lane_and_its_text_is_shown(tmp_path: Path) -> None:
    went = ProgramCall(
        number=1, name="navigate", args={"to": "kitchen"}, started_s=1.0, ended_s=5.0
    )
    asked = ProgramCall(number=2, name="ask", args={"subject": "cup_1"}, started_s=5.0, ended_s=5.0)
    slipped = ProgramCall(
        number=3, name="pick", args={"object": "cup_1"}, reason="no", started_s=6.0, ended_s=9.0
    )
    trace = ProgramTrace(code='navigate("kitchen")\n', calls=(went,))
    address = ReportAddress(robot="hsr", plan="p9", task="t1", attempt=1)
    first = Report(
        robot="hsr",
        plan="p9",
        revision=1,
        task="t1",
        attempt=1,
        epoch=1,
        incarnation="i",
        state=ReportState.STARTED,
        started_s=1.0,
        program=trace,
    )
    more = replace(first, program=replace(trace, calls=(went, asked, slipped)))
    path = written(
        tmp_path / "program.rrd",
        [put(keys.REPORT, address, first, 5.1), put(keys.REPORT, address, more, 9.1)],
    )
    assert lanes(path, "hsr/program") == [
        (1.0, "navigate kitchen"),
        (5.0, ""),
        (6.0, "✗ pick cup_1"),
        (9.0, ""),
    ]
    (text,) = rows(path, "/fleet/program", "text")
    assert text.value[0].startswith("### hsr: t1 of p9\n```python\nnavigate(")
    assert "/fleet/log/reports" in summary(path).entities


def test_the_next_file_begins_with_what_stands_and_what_is_closed(tmp_path: Path) -> None:
    closure = Closure(closure="c", names=("hallway",), region_m=((4.0, 0.0, 6.0, 6.0),))
    changes = [
        *mission(1.0),
        put(keys.STOP, StopAddress(stop="s"), Stop(stop="s"), 86.0),
        put(keys.CLOSURE, ClosureAddress(closure="c"), closure, 87.0),
    ]
    recorder = Recorder(open_stream(tmp_path / "first.rrd", "test"))
    for change in changes:
        recorder.record(change)
    recorder.continue_in(open_stream(tmp_path / "second.rrd", "test"))
    clock = SimClock(time_s=95.0, wall_time_s=WALL_S + 95.0, speed=1.0)
    recorder.record(put(keys.SIM_CLOCK, SimAddress(), clock, 95.0))
    recorder.record(put(keys.STOP, StopAddress(stop="s"), None, 95.0))
    recorder.close()
    for robot in ("hsr", "locobot"):
        assert [label for _, label in lanes(tmp_path / "second.rrd", robot)] == ["stopped", ""]
    assert rows(tmp_path / "second.rrd", "/world/closures/c", "half_sizes")
    assert said(tmp_path / "second.rrd", "stops") == [("INFO", "emergency stop s is over")]
