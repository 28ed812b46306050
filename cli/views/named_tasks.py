"""Tasks that goals can name, as a table; and what a text that calls one would mean."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from rich.table import Table

from cli.views.console import table
from keyexpr_schema.payloads.methods import KnownTask, TasksReply


def named_tasks_table(known: Iterable[KnownTask]) -> Table:
    """One line a task."""
    return table(
        ["task", "said as", "ways", "from", "what it is"],
        (
            (task.task, "\n".join(task.says), task.methods, Path(task.file).name, task.about)
            for task in known
        ),
    )


def explanation(reply: TasksReply) -> str:
    """What a text would mean: the tasks in it, their methods, and the conditions."""
    return "\n".join(_lines(reply))


def _lines(reply: TasksReply) -> Iterator[str]:
    if not reply.called and reply.understood is not None:
        yield "it calls no task by name"
    for call in reply.called:
        yield f"{call.said!r} is the task {call.task}"
        for number, method in enumerate(call.methods, 1):
            verdict = "taken" if method.taken else f"passed over: {method.reason}"
            yield f"  {number}. {method.text}"
            yield f"     {verdict}"
    if reply.understood is None:
        return
    yield f"understood as {reply.understood}"
    for number, stage in enumerate(reply.stages, 1):
        yield f"  {'then' if number > 1 else 'what must hold'}:"
        yield from (f"    {condition}" for condition in stage)
    for word, rows in (("always", reply.always), ("never", reply.never)):
        yield from (f"  {word} {condition}" for condition in rows)
