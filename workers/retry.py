"""The retry machine: up to three tries of a skill in an attempt, under a deadline, cancellable.

It knows nothing of Zenoh or of robots: it is given one try to run, a clock, and a way to bring the
robot to a safe state.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from msgspec.structs import replace

from keyexpr_schema.errors import SchemaError
from keyexpr_schema.payloads.tasks import Report, ReportState, Try
from workers.errors import RobotUnreachable, SkillFailed

MOST_TRIES = 3
CLOCK_S, LONGEST_CLOCK_S = 0.05, 0.5
"""Wall seconds between two looks at the fleet's clock, whose ticks nobody announces: the more
seldom the farther off the deadline is, as fast as the clock has gone since the start of the try."""

_log = logging.getLogger("robotfleet.worker.retry")


@dataclass(frozen=True)
class _TryFailure:
    state: ReportState
    reason: str
    retryable: bool
    again: bool
    """Whether the machine itself may try once more."""


async def run_attempt(
    report: Report,
    name: str,
    once: Callable[[], Awaitable[None]],
    *,
    now_s: Callable[[], float],
    make_safe: Callable[[], Awaitable[None]],
    deadline_s: float,
    cancelled: asyncio.Event,
    on_failure: Callable[[SkillFailed], None] = lambda failure: None,
    most_tries: int = MOST_TRIES,
    started_s: float | None = None,
) -> Report:
    """Run `once` until it returns, but at most `most_tries` times; `report` with how it ended.

    A try ends by returning (success), by `SkillFailed`, by any other exception (a bug in the
    skill: no further try), at the deadline (`deadline_s` fleet seconds after the start of the
    attempt), or when `cancelled` is set. After every try that did not succeed, and so before the
    next one, `make_safe` is awaited. `on_failure` hears of every `SkillFailed`. `started_s` is when
    the attempt started, if that was before now.

    Being cancelled itself, it stops the try and passes `CancelledError` on.
    """
    started_s = now_s() if started_s is None else started_s
    tries: list[Try] = []
    while True:
        began_s = now_s()
        failure = await _one_try(
            name,
            once,
            now_s=now_s,
            due_s=started_s + deadline_s,
            deadline_s=deadline_s,
            cancelled=cancelled,
            on_failure=on_failure,
        )
        ended_s, reason = now_s(), None if failure is None else failure.reason
        number = len(tries) + 1
        tries.append(Try(number=number, started_s=began_s, ended_s=ended_s, reason=reason))
        if failure is not None:
            await make_safe()
            ended_s = now_s()
            if failure.again and number < most_tries:
                continue
        return replace(
            report,
            state=ReportState.SUCCEEDED if failure is None else failure.state,
            tries=tuple(tries),
            reason=reason,
            retryable=failure is None or failure.retryable,
            started_s=started_s,
            ended_s=ended_s,
        )


async def _one_try(
    name: str,
    once: Callable[[], Awaitable[None]],
    *,
    now_s: Callable[[], float],
    due_s: float,
    deadline_s: float,
    cancelled: asyncio.Event,
    on_failure: Callable[[SkillFailed], None],
) -> _TryFailure | None:
    running = asyncio.ensure_future(once())
    cancel = asyncio.ensure_future(cancelled.wait())
    late = False
    loop = asyncio.get_running_loop()
    began_s, began_wall_s, pause_s = now_s(), loop.time(), CLOCK_S / 2
    try:
        while not running.done() and not cancelled.is_set():
            if late := now_s() >= due_s:
                break
            speed = max(1.0, (now_s() - began_s) / max(1e-3, loop.time() - began_wall_s))
            due_wall_s = (due_s - now_s()) / speed
            pause_s = min(LONGEST_CLOCK_S, 2 * pause_s, max(CLOCK_S, due_wall_s / 2))
            await asyncio.wait(
                {running, cancel}, timeout=pause_s, return_when=asyncio.FIRST_COMPLETED
            )
    finally:
        cancel.cancel()
        running.cancel()
        await asyncio.wait({running, cancel})
    if not running.cancelled() and (error := running.exception()) is None:
        return None
    if cancelled.is_set():
        return _TryFailure(ReportState.CANCELLED, "the order was cancelled", True, again=False)
    if late:
        return _TryFailure(
            ReportState.FAILED,
            f"{name} was not done within its deadline of {deadline_s:g} s",
            True,
            again=False,
        )
    if running.cancelled():
        reason = f"unexpected error in skill {name}: it cancelled itself"
        return _TryFailure(ReportState.FAILED, reason, False, again=False)
    return _failure_of(name, error, on_failure)


def _failure_of(
    name: str, error: BaseException | None, on_failure: Callable[[SkillFailed], None]
) -> _TryFailure:
    if isinstance(error, SkillFailed):
        on_failure(error)
        return _TryFailure(ReportState.FAILED, error.reason, error.retryable, again=error.retryable)
    if isinstance(error, (RobotUnreachable, SchemaError)):
        return _TryFailure(ReportState.FAILED, str(error), True, again=True)
    _log.error("unexpected error in skill %s", name, exc_info=error)
    reason = f"unexpected error in skill {name}: {type(error).__name__}: {error}"
    return _TryFailure(ReportState.FAILED, reason, False, again=False)
