"""Asks the planner for something and brings back its answer."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from cli.errors import NotRunning, Refused, TooLate
from cli.presence import planner_alive
from keyexpr_schema.keyspace import ANSWER, CONTROL_REQUEST, PLAN_REQUEST, REPLAN_REQUEST
from keyexpr_schema.payloads.requests import (
    Answer,
    ControlRequest,
    PlanRequest,
    ReplanRequest,
    RequestAddress,
)

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

ANSWER_S = 120.0
"""Longest time to wait for an answer: planning with a language model takes its time."""

Request = PlanRequest | ReplanRequest | ControlRequest


async def ask_planner(session: Session, request: Request, timeout_s: float = ANSWER_S) -> Answer:
    """Put `request` and wait for its answer.

    With no planner there the request is not put: it would be carried out whenever one starts, long
    after anybody remembers it.

    Raises:
        NotRunning: no planner is connected.
        Refused: the planner said no; the message is its sentence and every violation.
        TooLate: the planner did not answer within `timeout_s` [s].
    """
    if not await planner_alive(session):
        raise NotRunning("no planner is running; start one with `robotctl planner`")
    address = RequestAddress(request.request)
    if isinstance(request, PlanRequest):
        await session.confirm(PLAN_REQUEST, address, request)
    elif isinstance(request, ReplanRequest):
        await session.confirm(REPLAN_REQUEST, address, request)
    else:
        await session.confirm(CONTROL_REQUEST, address, request)
    answer = await _answer(session, request.request, timeout_s)
    if not answer.accepted:
        more = [each.sentence for each in answer.violations if each.sentence not in answer.sentence]
        raise Refused("; ".join([answer.sentence, *more]))
    return answer


async def _answer(session: Session, request: str, timeout_s: float) -> Answer:
    try:
        async with (
            asyncio.timeout(timeout_s),
            session.watch((ANSWER, {"request": request})) as watch,
        ):
            async for change in watch:
                if change.value is not None:
                    answer: Answer = change.value
                    return answer
    except TimeoutError:
        pass
    raise TooLate(f"the planner did not answer request {request} within {timeout_s:g} s")
