"""What a planner is made of: plug-ins of installed packages are in it, broken ones are left out."""

from __future__ import annotations

from pathlib import Path

import pytest

from fleet.errors import BadSkillFile
from fleet.service.composition import compose
from fleet.service.skill_models import load_all_skills
from tests.support.plug_in_site import plug_in_site

CODE = """
from pathlib import Path
from fleet.allocators import Assignment, RoundRobinAllocator
from fleet.planners import NoPlan, Planner, ProgramWriter

class Lazy(Planner):
    name, strategies = "lazy", ("siesta",)
    def _solve(self, problem):
        return NoPlan("tomorrow")

class Needy(Lazy):
    def __init__(self, wish): ...

class Turns(RoundRobinAllocator):
    name = "turns"

class Nameless(RoundRobinAllocator):
    name = None

class Impostor(Lazy):
    name = "symbolic"

class Scribe(ProgramWriter):
    name = "scribe"
    def _write(self, task):
        return "navigate('kitchen')"

class OneWord(Lazy):
    name, strategies = "one-word", "siesta"

FILE = Path(__file__).with_name("wave.yaml")
AGAIN = {"skills": {"wave": {"parameters": {"robot": "robot"}}}}
"""
ENTRIES = {
    "robotfleet.planners": {
        "lazy": "Lazy",
        "needy": "Needy",
        "turns": "Turns",
        "impostor": "Impostor",
        "one-word": "OneWord",
    },
    "robotfleet.allocators": {"turns": "Turns", "lazy": "Lazy", "nameless": "Nameless"},
    "robotfleet.program_writers": {"hsr": "Scribe", "locobot": "Lazy"},
    "robotfleet.skill_models": {"wave": "FILE", "again": "AGAIN"},
}
WAVE = "skills: {wave: {parameters: {robot: robot}, after: [waved(robot) = true]}}\n"


@pytest.fixture
def theirs(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    site = tmp_path_factory.mktemp("site")
    (site / "wave.yaml").write_text(WAVE)
    monkeypatch.syspath_prepend(plug_in_site(site, CODE, ENTRIES))
    return site


def test_sound_plug_ins_are_there_and_each_broken_one_is_named(
    theirs: Path, caplog: pytest.LogCaptureFixture
) -> None:
    made = compose()
    assert {"symbolic", "llm", "lazy"} == set(made.planners)
    assert "siesta" in made.strategies
    assert {"makespan", "turns"} <= set(made.allocators) and "lazy" not in made.allocators
    assert {"navigate", "wave"} <= set(load_all_skills())
    warnings = [record.getMessage() for record in caplog.records]
    assert [writer.name for writer in made.program_writers.values()] == ["scribe"]
    assert len(warnings) == 8
    for entry, what in (
        ("theirs:Needy as 'needy'", "missing 1 required positional argument: 'wish'"),
        ("theirs:Turns as 'turns' in robotfleet.planners", "which is no Planner"),
        ("theirs:Lazy as 'lazy' in robotfleet.allocators", "which is no Allocator"),
        ("theirs:Impostor as 'impostor'", "there is a Planner called 'symbolic' already"),
        ("theirs:OneWord as 'one-word'", "Expected `array`, got `str`"),
        ("theirs:Nameless as 'nameless'", "Expected `str`, got `null`"),
        ("theirs:Lazy as 'locobot'", "which is no ProgramWriter"),
        ("theirs:AGAIN as 'again'", "skill wave is already modelled elsewhere"),
    ):
        (warning,) = [each for each in warnings if entry in each]
        assert warning.startswith("package theirs offers") and what in warning


def test_a_file_that_models_a_packages_skill_is_refused(theirs: Path) -> None:
    with pytest.raises(BadSkillFile, match=r"wave\.yaml: skill wave is already modelled elsewhere"):
        load_all_skills((theirs / "wave.yaml",))
