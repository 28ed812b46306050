"""One goal on a page."""

from __future__ import annotations

from rich.console import Group
from rich.text import Text

from cli.show.fleet_tables import GoalRow
from cli.show.words import STATE_STYLE, seconds
from keyexpr_schema.payloads.goals import GoalState


def goal_page(row: GoalRow) -> Group:
    """Its words, what they were understood as, where it stands and why."""
    status = row.status
    state = (status.state if status else GoalState.WAITING).value
    lines = [Text.assemble((row.goal, "bold"), "  ", (state, STATE_STYLE.get(state, "")))]
    if row.spec is not None:
        lines.append(Text(f"wanted      “{row.spec.text}”"))
        lines.append(Text(f"priority    {row.spec.priority}"))
        if row.spec.due_s is not None:
            lines.append(Text(f"due         {seconds(row.spec.due_s)} on the fleet's clock"))
    if status is None:
        lines.append(Text("understood  nobody has read it yet: no planner runs", "dim"))
        return Group(*lines)
    stages = status.stages or ((status.conditions,) if status.conditions else ())
    for number, stage in enumerate(stages):
        head = "understood  " if number == 0 else "then        "
        now = "  ← now" if len(stages) > 1 and number == status.stage else ""
        lines.append(Text(f"{head}{' and '.join(str(each) for each in stage)}{now}"))
    if status.plan:
        lines.append(Text(f"plan        {status.plan}"))
    if status.note:
        lines.append(Text(f"note        {status.note}"))
    if status.reason:
        lines.append(Text(f"reason      {status.reason}", "red"))
    lines.append(Text(f"since       {seconds(status.time_s)} on the fleet's clock"))
    return Group(*lines)
