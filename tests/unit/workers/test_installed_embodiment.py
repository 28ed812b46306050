"""An embodiment of an installed package: what is wrong with it is a sentence."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.errors import BrokenPlugIn
from workers.embodiment import installed_embodiment
from workers.errors import RobotUnreachable

CODE = """
from unittest.mock import create_autospec
from workers import Embodiment, RobotUnreachable

def sound(session, spec, incarnation):
    return create_autospec(Embodiment, instance=True, robot=spec)

def portless(session, spec, incarnation):
    raise OSError("no such serial port")

def away(session, spec, incarnation):
    raise RobotUnreachable("its driver is off")

def nothing(session, spec, incarnation):
    return None
"""


@pytest.fixture(autouse=True)
def theirs(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    site = tmp_path_factory.mktemp("site")
    (site / "their_robots.py").write_text(CODE)
    info: Path = site / "their_robots-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-robots\nVersion: 1\n")
    names = ("sound", "portless", "away", "nothing")
    entries = "".join(f"{name} = their_robots:{name}\n" for name in names)
    (info / "entry_points.txt").write_text(f"[robotfleet.embodiments]\n{entries}")
    monkeypatch.syspath_prepend(site)


def make(name: str) -> Any:
    session: Any = None
    spec: Any = "hsr"
    return installed_embodiment(name)(session, spec, "hsr-1")


def test_a_sound_one_is_made() -> None:
    assert make("sound").robot == "hsr"


def test_one_that_cannot_be_made_is_a_sentence() -> None:
    with pytest.raises(BrokenPlugIn, match="'portless' cannot be made: OSError: no such serial"):
        make("portless")
    with pytest.raises(BrokenPlugIn, match="'nothing' is None, which is no Embodiment"):
        make("nothing")


def test_a_robot_that_does_not_answer_is_no_broken_plug_in() -> None:
    with pytest.raises(RobotUnreachable, match="its driver is off"):
        make("away")
