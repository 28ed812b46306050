"""Tasks written as entries of task files read as they were."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from fleet.errors import BadTaskFile
from fleet.language.methods.entry import entry_of
from fleet.language.methods.model import CompoundTask, Method
from fleet.language.methods.task_file import tasks_from_data
from fleet.service.task_files import add_task, load_all_tasks, load_tasks
from keyexpr_schema.yaml_reader import parsed_yaml

ODD = CompoundTask(
    name="make_tea",
    says=("make tea", 'brew "tea: hot" [for {n: number}]'),
    methods=(
        Method(do=(("bring {n} cups to the hall",), ("open # it", "shut it")), needs=("{n} cup",)),
        Method(do=(("find {n} cups",),)),
    ),
    about="what it's about: tea",
    defaults={"n": "2"},
)


@pytest.mark.parametrize("task", [*load_all_tasks(), ODD], ids=lambda task: task.name)
def test_an_entry_reads_as_the_task_that_it_is_of(task: CompoundTask) -> None:
    (again,) = tasks_from_data(parsed_yaml(f"tasks:\n{entry_of(task)}", ValueError, "here"), "here")
    assert again == replace(task, file="here")


def test_tasks_are_added_behind_those_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "more" / "mine.yaml"
    add_task(path, entry_of(ODD))
    text = f"# my tasks\n{path.read_text()}  # the end\n\n\n"
    path.write_text(text)
    coffee = CompoundTask(
        name="make_coffee", says=("make coffee",), methods=(Method(do=(("find a cup",),)),)
    )
    add_task(path, entry_of(coffee))
    assert [task.name for task in load_tasks(path)] == ["make_tea", "make_coffee"]
    assert path.read_text().startswith(text.rstrip())
    assert [each.name for each in path.parent.iterdir()] == ["mine.yaml"]


@pytest.mark.parametrize(
    ("there", "words"),
    [
        ("tasks:\n" + entry_of(ODD), "there is a task make_tea already"),
        ("skills: {}", "there must be a mapping `tasks:`"),
        ("tasks: {}", "is not YAML"),
        ("tasks: [", "is not YAML"),
        ("tasks:\n    make_it: {says: [make it], do: [find a cup]}\n", "is not YAML"),
    ],
)
def test_a_file_that_cannot_take_a_task_stays_as_it_was(
    tmp_path: Path, there: str, words: str
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(there)
    with pytest.raises(BadTaskFile) as raised:
        add_task(path, entry_of(ODD))
    assert words in str(raised.value)
    assert str(path) in str(raised.value)
    assert path.read_text() == there
