"""Programs: their text, and what they did call by call."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from cli.views.console import table
from cli.views.text import seconds
from keyexpr_schema.facts import render_value
from keyexpr_schema.payloads.programs import ProgramCall, ProgramTrace
from keyexpr_schema.payloads.tasks import Report, TaskRecord

if TYPE_CHECKING:
    from rich.console import RenderableType


def program_lines(record: TaskRecord, reports: Iterable[Report]) -> list[RenderableType]:
    """The program of a task, if it has one, and the trace of each attempt that has ended."""
    if record.program is None:
        return []
    by = f" (written by {record.program.made_by})" if record.program.made_by else ""
    parts: list[RenderableType] = ["", Text(f"Program{by}:"), Text(record.program.code.rstrip())]
    for report in reports:
        if (trace := report.program) is not None:
            parts += ["", Text(_ending(report, trace)), trace_table(trace)]
    return parts


def trace_table(trace: ProgramTrace) -> RenderableType:
    """One line a call."""
    rows: list[Sequence[object]] = [
        (
            call.number,
            call.line or "",
            call_text(call),
            "failed"
            if call.reason is not None
            else render_value(call.result)
            if call.name == "ask"
            else "done",
            call.tries or "",
            seconds(call.ended_s - call.started_s),
            call.reason,
        )
        for call in trace.calls
    ]
    return table(["call", "line", "what", "result", "tries", "spent", "why"], rows)


def call_text(call: ProgramCall) -> str:
    """A call as it is written."""
    return f"{call.name}({', '.join(render_value(value) for value in call.args.values())})"


def _ending(report: Report, trace: ProgramTrace) -> str:
    how = "runs" if trace.end is None else f"ended: {trace.end.value}"
    why = f", {trace.reason}" if trace.reason else ""
    return f"Attempt {report.attempt} {how}{why}"
