"""A picture of a recording: with a graphics driver, without one, and of what is no recording."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import pytest

from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.drawing.text import DRAWN
from fleet.timeline.recorder import Recorder
from fleet.timeline.screenshot import DRIVER, main
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from tests.support.timeline_mission import mission, put


def driver_is_installed() -> bool:
    folders = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
    return any(any(folder.glob("*.json")) for folder in folders if folder.is_dir())


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("screenshot") / "mission.rrd"
    recorder = Recorder(open_stream(path, "test"))
    for change in mission(0.5):
        recorder.record(change)
    recorder.close()
    return path


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or not driver_is_installed(), reason=f"needs {DRIVER} or another driver"
)
def test_a_picture_has_the_size_asked_for_and_changes_with_time(recording, tmp_path):
    early, late = tmp_path / "early.png", tmp_path / "late.png"
    assert main([str(recording), str(early), "--at", "3", "--size", "800x450"]) == 0
    assert main([str(recording), str(late), "--size", "800x450"]) == 0
    for picture in (early, late):
        data = picture.read_bytes()
        assert data.startswith(b"\x89PNG")
        assert struct.unpack(">II", data[16:24]) == (800, 450)
    assert early.read_bytes() != late.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux" or not driver_is_installed(), reason=f"needs {DRIVER} or another driver"
)
def test_a_sentence_in_any_script_can_be_drawn(tmp_path):
    """The viewer ends at a character that its font lacks, so every one that we let through."""
    path = tmp_path / "glyphs.rrd"
    recorder = Recorder(open_stream(path, "杯子 ☕"))
    signs = sorted(DRAWN - {"\n"})
    lines = ["".join(signs[i : i + 30]) for i in range(0, len(signs), 30)]
    for number, text in enumerate(["把第一个杯子拿到走廊 ☕", *lines]):
        goal = f"g{number}"
        at_s = 1.0 + 0.01 * number
        recorder.record(put(GOAL_SPEC, GoalAddress(goal=goal), Goal(goal=goal, text=text), at_s))
    recorder.close()
    assert main([str(path), str(tmp_path / "glyphs.png"), "--size", "1600x2000"]) == 0
    assert (tmp_path / "glyphs.png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform != "linux", reason="hides the drivers as the Linux loader finds them"
)
def test_without_a_driver_it_names_the_package(recording, tmp_path, monkeypatch, capsys):
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, "/nonexistent")
    assert main([str(recording), str(tmp_path / "x.png")]) == 1
    said = capsys.readouterr().err.strip()
    assert DRIVER in said
    assert len(said.splitlines()) == 1


def test_what_is_no_recording_is_told_in_a_sentence(tmp_path, capsys):
    assert main([str(tmp_path / "none.rrd"), str(tmp_path / "x.png")]) == 1
    assert capsys.readouterr().err == f"there is no recording at {tmp_path / 'none.rrd'}\n"
