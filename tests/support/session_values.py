"""Values to put, and how they are read from a watch: for the tests of the session."""

from __future__ import annotations

import asyncio
from typing import Any

from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.motions import Senses
from keyexpr_schema.payloads.simulation import MotionCall
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.session import Session, Watch
from tests.support.polling import DEADLINE_S

AT = FactAddress("cup_1", "at")


def goal(name: str, text: str = "bring the cup") -> Goal:
    return Goal(goal=name, text=text)


def fact(value: int) -> Fact:
    return Fact(subject="cup_1", relation="at", value=value, source="test")


def motion_call(name: str) -> MotionCall:
    return MotionCall(call=name, incarnation="i1")


def senses(time_s: float) -> Senses:
    return Senses(robot="r1", time_s=time_s, pose_m_rad=(0.0, 0.0, 0.0), place=None)


async def not_connected(session: Session) -> bool:
    return not session.connected


async def take(watch: Any, count: int, timeout_s: float = DEADLINE_S) -> list[Any]:
    async with asyncio.timeout(timeout_s):
        return [await anext(watch) for _ in range(count)]


async def take_until_value(watch: Watch, value: object, timeout_s: float = DEADLINE_S) -> list[Any]:
    seen = []
    async with asyncio.timeout(timeout_s):
        async for change in watch:
            seen.append(None if change.value is None else change.value.value)
            if seen[-1] == value:
                break
    return seen
