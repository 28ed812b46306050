"""Every whole file that the documentation shows is one that is read without a mistake."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fleet.service.skill_models import load_skills
from fleet.service.task_files import load_tasks
from fleet.service.word_files import load_words
from sim.files.mission_file import load_mission
from sim.files.robot_file import load_robot
from sim.files.world_file import load_world

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```yaml\n(.*?)^```", re.MULTILINE | re.DOTALL)
READERS: dict[str, Callable[[Path], object]] = {
    "world": load_world,
    "mission": load_mission,
    "robot": load_robot,
    "relations": load_skills,
    "skills": load_skills,
    "tasks": load_tasks,
    "verbs": lambda path: load_words((path,)),
}
"""What reads a file that begins with a key."""


def documented() -> Iterator[tuple[str, str]]:
    """Page and text of every file that is shown; one with `…` in a line of its own is not whole."""
    for page in PAGES:
        for block in BLOCK.findall(page.read_text(encoding="utf-8")):
            if block.partition(":")[0] in READERS and not re.search(r"^\s*(# )?…", block, re.M):
                yield str(page.relative_to(ROOT)), block


@pytest.mark.parametrize(("page", "text"), list(documented()))
def test_a_file_that_is_shown_can_be_copied(page: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "copied.yaml").write_text(text, encoding="utf-8")
    assert READERS[text.partition(":")[0]](tmp_path / "copied.yaml")


def test_files_were_found() -> None:
    pages = {page for page, _ in documented()}
    assert {"docs/configuration-worlds.md", "docs/planning.md", "docs/tasks.md"} <= pages
