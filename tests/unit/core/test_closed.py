"""The core is closed: what a journal leads to depends on nothing beside it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from fleet.core.events import decode_event, encode_event
from fleet.core.model.skills import SkillModel
from fleet.core.state import State
from fleet.core.step import replay
from fleet.service.skill_models import load_all_skills
from tests.support.fleet_model import BOTH, FleetModel, fleet

OTHER_SKILLS = """
skills:
  navigate:
    parameters: {robot: robot, to: place}
    after: [at(robot) = to]
    duration_s: 999
"""
HASHED = """
import sys, zlib
from fleet.core.events import decode_event
from fleet.core.state import State
from fleet.core.step import step
state, told = State(), []
for line in open(sys.argv[1], "rb").read().splitlines():
    state, effects = step(state, decode_event(line))
    told += map(repr, effects)
print(zlib.crc32("".join(told).encode()), len(told))
"""


def lived() -> FleetModel:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    return model


def test_a_journal_replays_to_the_same_state_whatever_the_skill_files_say(tmp_path: Path) -> None:
    path = tmp_path / "other.yaml"
    path.write_text(OTHER_SKILLS)
    others: dict[str, SkillModel] = load_all_skills((path,))
    model = lived()
    journal = [decode_event(line) for line in model.journal]
    assert others["navigate"] != model.state.skills["navigate"]
    assert replay(journal) == model.state
    assert replay(journal, State(skills=others)) == model.state


def test_a_journal_replays_to_the_same_effects_whatever_strings_hash_to(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    lines = [encode_event(decode_event(line)) for line in lived().journal]
    path.write_bytes(b"\n".join(lines))
    told = {
        subprocess.run(
            [sys.executable, "-c", HASHED, path],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(told) == 1
    assert int(told.pop().split()[1]) > 20
