"""What is waited for, in a column."""

from __future__ import annotations

from collections.abc import Iterable

from cli.times import moment
from keyexpr_schema.payloads.waits import WaitKind, WaitReason


def waits_shown(reasons: Iterable[WaitReason], plan: str | None = None) -> str:
    """`t1, t2; hsr is busy with plan-2/t4`: tasks of the same `plan` by their own names."""
    found = list(reasons)
    tasks = [
        str(reason.task if reason.plan == plan else reason)
        for reason in found
        if reason.kind is WaitKind.TASK
    ]
    others = [
        f"it is due {moment(None, reason.due_s)}"
        if reason.due_s is not None and reason.sentence is None
        else str(reason)
        for reason in found
        if reason.kind is not WaitKind.TASK
    ]
    return "; ".join([*([", ".join(tasks)] if tasks else []), *dict.fromkeys(others)])


def why_shown(reasons: Iterable[WaitReason], reason: str | None, plan: str | None = None) -> str:
    """What is waited for, and the reason that is given besides, if it says more."""
    waits = waits_shown(reasons, plan)
    if not reason or reason in waits:
        return waits
    return f"{waits}; {reason}" if waits else reason
