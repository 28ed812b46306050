"""The tasks that goals can call by name: those that are shipped, and those in a user's files."""

from __future__ import annotations

from pathlib import Path

from fleet.errors import BadTaskFile
from fleet.language.methods.model import CompoundTask
from fleet.language.methods.patterns import Row, rows_of
from fleet.language.methods.task_file import tasks_from_data
from keyexpr_schema.config_files import config_file
from keyexpr_schema.whole_files import make_folder, write_whole
from keyexpr_schema.yaml_reader import parsed_yaml, read_yaml_file


def load_all_tasks(task_files: tuple[Path, ...] = ()) -> tuple[CompoundTask, ...]:
    """The tasks in these files, and those of the household that they do not say anew.

    What a user's own file calls by a phrase goes before what the household's does.

    Raises:
        BadTaskFile: a file cannot be read, or two of these files say the same.
    """
    own: dict[str, CompoundTask] = {}
    said: dict[Row, str] = {}
    for path in task_files:
        for task in load_tasks(path):
            if task.name in own:
                raise BadTaskFile(f"{path}: task {task.name} is in {own[task.name].file} already")
            own[task.name] = task
            for row in {row for phrase in task.says for row in rows_of(phrase)}:
                if (other := said.setdefault(row, task.name)) != task.name:
                    words = " ".join(p if isinstance(p, str) else f"{{{p.name}}}" for p in row)
                    raise BadTaskFile(f"{path}: task {task.name}: {words!r} calls {other} already")
    shipped = load_tasks(config_file("tasks", "household"))
    return (*own.values(), *(task for task in shipped if task.name not in own))


def load_tasks(path: Path) -> tuple[CompoundTask, ...]:
    """The tasks in a YAML file.

    Raises:
        BadTaskFile: it cannot be read, or what is in it is not right.
    """
    file = read_yaml_file(path, BadTaskFile)
    return tasks_from_data(file.data, file)


def add_task(path: Path, entry: str) -> CompoundTask:
    """Write a task behind those of a file, which is made if need be; `entry` is that of `entry_of`.

    Raises:
        BadTaskFile: the file is none of tasks, has one of that name, or cannot be written.
    """
    (task,) = tasks_from_data(parsed_yaml(f"tasks:\n{entry}", BadTaskFile, str(path)), str(path))
    known = load_tasks(path) if path.exists() else ()
    if any(task.name == other.name for other in known):
        raise BadTaskFile(f"{path}: there is a task {task.name} already")
    try:
        text = path.read_text(encoding="utf-8") if path.exists() else "tasks:\n"
        text = f"{text.rstrip()}\n{entry}"
        written = tasks_from_data(parsed_yaml(text, BadTaskFile, str(path)), str(path))
        if [each.name for each in written] != [*(each.name for each in known), task.name]:
            raise BadTaskFile(f"{path}: nothing can be written behind what stands there")
        make_folder(path.parent)
        write_whole(path, text.encode())
    except OSError as error:
        raise BadTaskFile(f"{path} cannot be written: {error.strerror}") from None
    return task
