"""Recordings that roll, and what a recorder keeps of what is over."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from fleet.timeline.drawing.gantt import LOOKS, Bar, Lane
from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.errors import UnwritableRecording
from fleet.timeline.pieces import Pieces
from fleet.timeline.reader import rows, summary
from fleet.timeline.recorder import Recorder
from fleet.timeline.rolling import BadRolling, Rolling, RollingFiles, parse_rolling
from keyexpr_schema import keyspace as keys
from keyexpr_schema.payloads.plans import PlanAddress, PlanState
from keyexpr_schema.payloads.simulation import SimAddress, SimClock
from keyexpr_schema.payloads.tasks import TaskState
from tests.support.full_disk import no_room
from tests.support.polling import until
from tests.support.timeline_mission import END_S, WALL_S, Put, again, frames, put


def live(number: int) -> list[Put]:
    """One mission, and the clock each second of it."""
    ticks = []
    for second in range(int(END_S)):
        at_s = number * END_S + second
        clock = SimClock(time_s=at_s, wall_time_s=WALL_S + at_s, speed=1.0)
        ticks.append(put(keys.SIM_CLOCK, SimAddress(), clock, at_s))
    return sorted([*again(number), *ticks], key=lambda one: int(one.timestamp.split("/")[0]))


def threads() -> int:
    """How many this process has, those of libraries included."""
    return sum(1 for _ in Path("/proc/self/task").iterdir())


def ended(number: int) -> Put:
    """The end of a mission's plan."""
    (*_, last) = (one for one in again(number) if one.key is keys.PLAN_STATUS)
    assert last.value.state is PlanState.SUCCEEDED
    return last


def test_what_is_kept_does_not_grow_with_the_missions(tmp_path: Path) -> None:
    recorder = Recorder(open_stream(tmp_path / "many.rrd", "test"))
    kept = []
    for number in range(60):
        for change in live(number):
            recorder.record(change)
        recorder.flush()
        kept.append(len(recorder))
    recorder.close()
    assert len(set(kept[45:])) == 1, kept
    said = [row.value[0] for row in rows(tmp_path / "many.rrd", "/fleet/log/plans", "text")]
    assert [f"plan p1-{number} is succeeded" in said for number in range(60)] == [True] * 60


def test_what_is_kept_does_not_grow_where_the_clock_went_back(tmp_path: Path) -> None:
    """A simulation that began again is hours behind what was drawn before."""
    recorder = Recorder(open_stream(tmp_path / "again.rrd", "test"))
    kept = []
    for number in (*range(1000, 1010), *range(60)):
        for change in live(number):
            recorder.record(change)
        recorder.flush()
        kept.append(len(recorder))
    recorder.close()
    assert len(set(kept[60:])) == 1, kept
    busy = [
        row.value[0]
        for row in rows(tmp_path / "again.rrd", "/fleet/utilisation/all/fleet", "scalars")
        if row.sim_s is not None and row.sim_s < 60 * END_S
    ]
    assert len(busy) > 58 * END_S
    assert all(0.0 <= share <= 1.0 for share in busy)


def test_the_calls_of_a_mission_do_not_go_with_its_events(tmp_path: Path) -> None:
    """Rows go to Rerun together: a call for each entity and flush, however many there are."""
    calls = []
    for repeated in (1, 20):
        recorder = Recorder(open_stream(tmp_path / f"calls-{repeated}.rrd", "test"))
        for change in live(0):
            recorder.record(change)
        recorder.flush()
        had = recorder.calls
        for change in live(1):
            recorder.record(change)
            if change.key is keys.TASK_RECORD and change.value.robot is not None:
                for attempt in range(2, repeated + 1):  # each is a bar and two labels
                    value = msgspec.structs.replace(change.value, attempt=attempt)
                    recorder.record(dataclasses.replace(change, value=value))
        recorder.flush()
        calls.append(recorder.calls - had)
        recorder.close()
    few, many = calls
    assert few < 40
    assert many < 1.5 * few


def test_of_a_file_rerun_keeps_no_table_of_contents(tmp_path: Path) -> None:
    """It would grow with each piece of the file; a finished one says that it has none."""
    from rerun.chunk import RrdReader

    recorder = Recorder(open_stream(tmp_path / "open.rrd", "test"))
    for change in live(0):
        recorder.record(change)
    recorder.close()
    with pytest.warns(match="no footer"):
        assert list(RrdReader(tmp_path / "open.rrd").stream())


async def test_a_file_that_is_left_leaves_no_thread_behind(tmp_path: Path) -> None:
    recorder = Recorder(open_stream(tmp_path / "0.rrd", "test"))
    before = threads()
    for number in range(1, 6):
        for change in live(number):
            recorder.record(change)
        recorder.continue_in(open_stream(tmp_path / f"{number}.rrd", "test"))

    await until(lambda: threads() <= before, "the end of threads of files that were left")
    recorder.close()


def test_of_a_lane_only_the_latest_labels_are_kept() -> None:
    lane = Lane("/robots/r")
    for number in range(LOOKS + 7):
        lane.look(Bar(str(number), f"call {number}", (0, 0, 0, 0), float(number)))
    assert list(lane.looks) == [str(number) for number in range(7, LOOKS + 7)]


def test_what_comes_late_of_a_plan_that_is_forgotten_is_forgotten_again(tmp_path: Path) -> None:
    recorder = Recorder(open_stream(tmp_path / "late.rrd", "test"))
    for number in range(20):
        for change in again(number):
            recorder.record(change)
    before = len(recorder)
    for number in range(12):
        recorder.record(next(one for one in again(number) if one.key is keys.REPORT))
        recorder.record(next(one for one in again(number) if one.key is keys.TASK_RECORD))
    assert len(recorder) <= before
    recorder.close()


def test_a_graph_is_drawn_some_times_a_second_and_as_it_ended(tmp_path: Path) -> None:
    path = tmp_path / "busy.rrd"
    recorder = Recorder(open_stream(path, "test"))
    changes = again(0)
    for change in changes:
        recorder.record(change)
    (record,) = (
        one for one in changes if one.key is keys.TASK_RECORD and one.address.task == "t9"
        and one.value.state is TaskState.RUNNING
    )  # fmt: skip
    before = len(rows(path, "/fleet/dag/p1-0/1", "labels")) if path.stat().st_size else 0
    for attempt in range(2, 302):  # three hundred changes within a second
        value = msgspec.structs.replace(record.value, attempt=attempt)
        at_s = END_S + attempt / 302
        status = msgspec.structs.replace(ended(0).value, state=PlanState.RUNNING)
        recorder.record(put(keys.PLAN_STATUS, PlanAddress("p1-0"), status, at_s))
        recorder.record(put(keys.TASK_RECORD, record.address, value, at_s))
    end = msgspec.structs.replace(record.value, attempt=301, state=TaskState.FAILED)
    recorder.record(put(keys.TASK_RECORD, record.address, end, END_S + 1.0))
    recorder.close()
    drawn = rows(path, "/fleet/dag/p1-0/1", "labels")
    assert len(drawn) - before < 60
    assert any("✗ t9" in label for label in drawn[-1].value)


def test_each_file_is_complete_in_itself(tmp_path: Path) -> None:
    first, second = tmp_path / "a-0001.rrd", tmp_path / "a-0002.rrd"
    recorder = Recorder(open_stream(first, "test"))
    changes = sorted([*again(0), *frames()], key=lambda one: int(one.timestamp.split("/")[0]))
    half = next(
        at for at, one in enumerate(changes) if one.key is keys.SIM_CLOCK and one.value.time_s > 50
    )
    for change in changes[:half]:
        recorder.record(change)
    recorder.continue_in(open_stream(second, "test"))
    with_rest = summary(second) if second.stat().st_size else None
    assert with_rest is None or "/fleet/log/goals" not in with_rest.entities
    for change in changes[half:]:
        recorder.record(change)
    recorder.close()
    one, other = summary(first), summary(second)
    static = {path for path, entity in one.entities.items() if entity.static}
    assert {p for p in static if p.startswith("/world")} <= set(other.entities)
    assert one.sim_span_s is not None
    assert one.sim_span_s[1] <= 51.0
    labels = rows(second, "/fleet/dag/p1-0/1", "labels")
    assert len(labels[0].value[1:]) == 9
    assert sum("succeeded" in label for label in labels[0].value) == 5
    running = [row.value[0] for row in rows(second, "/robots/hsr", "state")]
    assert running[0].startswith("p1-0/")
    for robot in ("hsr", "locobot"):
        poses = rows(second, f"/world/bodies/{robot}/{robot}\\/base", "translation")
        assert poses[0].sim_s is not None
        assert poses[0].sim_s <= 51.0
    said = [row.value[0] for row in rows(second, "/fleet/log/goals", "text")]
    assert said
    assert not set(said) & {row.value[0] for row in rows(first, "/fleet/log/goals", "text")}


@pytest.mark.parametrize(
    ("every", "meant"),
    [
        ("90s", Rolling(seconds=90.0)),
        ("30min", Rolling(seconds=1800.0)),
        ("1.5 h", Rolling(seconds=5400.0)),
        ("500MB", Rolling(size_bytes=500 * 2.0**20)),
        ("2GB", Rolling(size_bytes=2 * 2.0**30)),
    ],
)
def test_when_to_roll_is_a_time_or_a_size(every: str, meant: Rolling) -> None:
    assert parse_rolling(every) == meant


@pytest.mark.parametrize("every", ["", "30", "min", "0min", "-1h", "5 minutes", "1e3MB", "nanMB"])
def test_what_is_neither_is_told(every: str) -> None:
    with pytest.raises(BadRolling, match=re.escape(f"{every!r} is no time and no size")):
        parse_rolling(every)


def test_less_than_one_file_cannot_be_kept() -> None:
    with pytest.raises(BadRolling, match="keep at least 1"):
        parse_rolling("1h", 0)


def test_files_are_numbered_on_and_the_oldest_go(tmp_path: Path) -> None:
    now: list[Any] = [100.0]
    for name in ("m-0007.rrd", "m-0003.rrd", "m-12.rrd", "other-0001.rrd", "m-0001.rrd.bak"):
        (tmp_path / name).touch()
    files = RollingFiles(tmp_path / "m.rrd", parse_rolling("1min", 2), lambda: now[0])
    assert files.due()
    files.next().touch()
    files.drop_oldest()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "m-0001.rrd.bak", "m-0007.rrd", "m-0008.rrd", "m-12.rrd", "other-0001.rrd",
    ]  # fmt: skip
    now[0] += 59.0
    assert not files.due()
    now[0] += 1.0
    assert files.due()
    current = files.current
    assert files.next() == tmp_path / "m-0009.rrd"
    files.stay(current)  # it could not be made
    assert not files.due()
    now[0] += 60.0
    assert files.due()


def test_a_file_rolls_by_its_size(tmp_path: Path) -> None:
    files = RollingFiles(tmp_path / "m.rrd", Rolling(size_bytes=10))
    files.next().write_bytes(b"123456789")
    assert not files.due()
    assert files.current is not None
    files.current.write_bytes(b"1234567890")
    assert files.due()


def test_a_recording_is_begun_over_no_other(tmp_path: Path) -> None:
    def begins_with() -> str:
        return Pieces(tmp_path / "today.rrd", "r", None, print, print).begins_with.name

    assert begins_with() == "today.rrd"
    (tmp_path / "today.rrd").touch()
    assert begins_with() == "today.rrd"  # there is nothing in it
    (tmp_path / "today.rrd").write_bytes(b"yesterday's")
    assert begins_with() == "today-0001.rrd"
    (tmp_path / "today-0001.rrd").touch()
    assert begins_with() == "today-0002.rrd"


def test_a_recording_that_cannot_be_begun_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with no_room(), pytest.raises(UnwritableRecording, match=r"File too large.*; free some room"):
        open_stream(tmp_path / "run.rrd", "a run")
    nearly_full = SimpleNamespace(total=2**34, free=2**20)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: nearly_full)
    new = Pieces(tmp_path / "new" / "run.rrd", "a run", None, print, print)
    with pytest.raises(UnwritableRecording, match="less than 16 MB are free there; free some"):
        new.first()
    assert not (tmp_path / "new").exists(), "nothing was begun"
