"""Publishes what people say: goals, statements and facts; each write is confirmed."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from cli.client.names import TakenMeanwhile, free_name, next_number, put_if_unchanged
from cli.errors import BadArgument, check_known
from fleet.service.time_zones import host_zone
from keyexpr_schema.facts import AT, CHARGE, HOLDING, IN, NOTHING, ON, parse_value
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    OBJECT,
    PLACE,
    ROBOT_SPEC,
    ROBOT_STATE,
    SCHEDULE_SPEC,
    SIM_CLOCK,
    SIM_SCENE,
    STATEMENT,
)
from keyexpr_schema.payloads.goals import Condition, Goal, GoalAddress, GoalStatus, Precedence
from keyexpr_schema.payloads.robots import FULL
from keyexpr_schema.payloads.schedules import Missed, Overlap, Schedule, ScheduleAddress
from keyexpr_schema.payloads.world import (
    PERSON_SOURCE,
    Fact,
    FactAddress,
    Feature,
    Statement,
    StatementAddress,
)

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


YES = "yes"
"""Says that a goal means the one thing that was made of it."""
CLOCK_S = 0.6
"""How long to listen for a simulation's clock [s, wall]; it ticks several times as often."""


@dataclass(frozen=True)
class Repeats:
    """What becomes of a schedule's times that nobody was there for, or that come too soon."""

    missed: Missed = Missed.ONCE
    overlap: Overlap = Overlap.SKIP


@dataclass(frozen=True)
class Later:
    """When a goal may begin, how often, and what has to hold: `in_s` counts from now [s].

    Times of day are of the time `zone`. With `repeats` it is put as a schedule.
    """

    in_s: float | None = None
    every: str | None = None
    when: tuple[Condition, ...] = ()
    only_if: tuple[Condition, ...] = ()
    by: tuple[str, ...] = ()
    whenever: tuple[Condition, ...] = ()
    zone: str | None = None
    repeats: Repeats | None = None

    def fields(self, said_s: float) -> dict[str, Any]:
        """As fields of a goal that is said at this time on the fleet's clock [s]."""
        not_before_s = None if self.in_s is None else said_s + self.in_s
        own = ("every", "when", "only_if", "by", "whenever", "zone")
        return {"not_before_s": not_before_s, **{name: getattr(self, name) for name in own}}


async def put_statement(
    session: Session,
    text: str,
    name: str | None = None,
    speaker: str | None = None,
    by: str = "",
) -> Statement:
    """Store a sentence, confirmed, under `name` or one made from its words.

    Raises:
        BadArgument: it has no words, or somebody else took the name in the same moment.
    """
    if not text.strip():
        raise BadArgument("say something, such as “The first cup is in the kitchen.”")
    said_s = await fleet_time_s(session)
    stored = {a.statement: known for a, known in (await session.list(STATEMENT)).items()}
    same = [n for n, known in stored.items() if (known.text, known.speaker) == (text, speaker)]
    while True:
        chosen = name or next(iter(same), None) or free_name(text, stored, "statement")
        statement = Statement(statement=chosen, text=text, said_s=said_s, speaker=speaker, by=by)
        try:
            await put_if_unchanged(
                session, STATEMENT, StatementAddress(chosen), statement, stored.get(chosen)
            )
        except TakenMeanwhile as taken:
            if name is not None:
                raise BadArgument(
                    f"somebody else has just said something as {name}: “{taken.by.text}”; "
                    "say it again to replace that, or use another --id"
                ) from None
            stored[chosen] = taken.by
            same = [chosen] if (taken.by.text, taken.by.speaker) == (text, speaker) else []
        else:
            return statement


async def put_fact(
    session: Session, relation: str, subject: str, written: str, *, by: str = ""
) -> Fact:
    """Store a fact, confirmed. What is on or in a known object is stored as where it is (`at`).

    Raises:
        Unknown: `at` of something that is no object or robot, or of a place that is none.
        BadArgument: something would be at itself, or in a hand what no hand holds; or a charge is
            none.
    """
    value = parse_value(written)
    if relation in (ON, IN) and written in [a.object for a in await session.list(OBJECT)]:
        relation = AT
    if relation == AT:
        how = "load a world with `robotctl world load FILE`"
        robots = [a.robot for a in await session.list(ROBOT_SPEC)]
        objects = [a.object for a in await session.list(OBJECT)]
        check_known("object or robot", subject, [*objects, *robots], how)
        if value is not None:
            places = [a.place for a in await session.list(PLACE)]
            check_known("place, object or robot", written, [*places, *objects, *robots], how)
            if written == subject:
                raise BadArgument(f"{subject} cannot be on or in itself")
    if relation in (HOLDING, CHARGE):
        check_known("robot", subject, [a.robot for a in await session.list(ROBOT_SPEC)])
    if relation == HOLDING and value not in (None, NOTHING):
        check_known("object", written, [a.object for a in await session.list(OBJECT)])
    if relation == CHARGE and value is not None:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 <= float(value) <= FULL:
            raise BadArgument(f"a charge is a number of percent from 0 to 100, and not {written}")
    fact = Fact(
        subject=subject,
        relation=relation,
        value=value,
        source=PERSON_SOURCE,
        time_s=await fleet_time_s(session),
        by=by,
    )
    await session.confirm(FACT, FactAddress.of(fact.key), fact)
    return fact


async def fleet_time_s(session: Session) -> float:
    """What is now on the fleet's clock [s]: a simulation's if there is one, else Unix time.

    A realm that has a simulated scene whose clock is not heard has stopped; then the time is the
    latest that a robot has reported: Unix time would outdate whatever the simulation says later.
    """
    if not await session.list(SIM_SCENE):
        return time.time()
    with suppress(TimeoutError):
        async with session.watch(SIM_CLOCK) as watch, asyncio.timeout(CLOCK_S):
            async for change in watch:
                if change.value is not None:
                    return float(change.value.time_s)
    states = (await session.list(ROBOT_STATE)).values()
    return max((state.time_s for state in states), default=0.0)


async def put_goal(
    session: Session,
    text: str,
    name: str | None,
    priority: int = 0,
    within_s: float | None = None,
    speaker: str | None = None,
    always: Sequence[Condition] = (),
    never: Sequence[Condition] = (),
    sometime_before: Sequence[Precedence] = (),
    later: Later | None = None,
    by: str = "",
) -> Goal:
    """Store a goal, confirmed, after all that were given before it; due `within_s` from now [s].

    What `later` says is repeated is stored as a schedule, which has this goal.

    Raises:
        BadArgument: it has no words, or there is a goal of that name.
        Unknown: `speaker` is no person in the world.
    """
    if not text.strip():
        raise BadArgument("say what you want, such as “Bring the first cup to the hallway.”")
    if speaker is not None:
        things = (await session.list(OBJECT)).values()
        people = [thing.object for thing in things if thing.is_a(Feature.PERSON)]
        check_known("person", speaker, people, "declare people in the world file")
    stored = await put_goals(session)
    known = {address.goal: status for address, status in (await session.list(GOAL_STATUS)).items()}
    if name is not None and name not in stored and (made := known.get(name)) is not None:
        _check_not_made(made)
    taken = {*stored, *known}
    said_s, said_at = await fleet_time_s(session), datetime.now().astimezone()
    highest = max((each.ordinal for each in stored.values()), default=0)
    ordinal = await next_number(session, "goals", "all", highest, returns=False)
    later = later or Later(zone=host_zone())
    while True:
        spec = Goal(
            goal=name if name is not None else free_name(text, taken, "goal", max(2, ordinal)),
            text=text,
            priority=priority,
            due_s=None if within_s is None else said_s + within_s,
            ordinal=ordinal,
            said_s=said_s,
            speaker=speaker,
            always=tuple(always),
            never=tuple(never),
            sometime_before=tuple(sometime_before),
            said_at=said_at.isoformat(timespec="milliseconds"),
            said_by=by,
            **later.fields(said_s),
        )
        if spec.goal not in stored and await _create(session, spec, later.repeats):
            return spec
        if name is not None:
            there = (await put_goals(session)).get(name)
            raise BadArgument(
                f"there is a goal {name!r} already: “{there.text if there else '?'}”; "
                "use another --id"
            )
        taken.add(spec.goal)


def _check_not_made(status: GoalStatus) -> None:
    """Do nothing if a person has put the goal, be it deleted by now.

    Raises:
        BadArgument: the planner, or a schedule, has made it: it cannot be two goals.
    """
    if status.own or status.part_of is not None:
        whose = "the planner's own" if status.own else f"a part of {status.part_of}"
        raise BadArgument(f"there is a goal {status.goal!r} already, {whose}; use another --id")


async def put_goals(session: Session) -> dict[str, Goal]:
    """What people want, by name: as goals, and as schedules."""
    scheduled = (await session.list(SCHEDULE_SPEC)).items()
    goals = (await session.list(GOAL_SPEC)).items()
    return {a.schedule: each.goal for a, each in scheduled} | {a.goal: each for a, each in goals}


async def _create(session: Session, spec: Goal, repeats: Repeats | None) -> bool:
    if repeats is None:
        return await session.create(GOAL_SPEC, GoalAddress(spec.goal), spec)
    schedule = Schedule(
        schedule=spec.goal, goal=spec, missed=repeats.missed, overlap=repeats.overlap
    )
    return await session.create(SCHEDULE_SPEC, ScheduleAddress(spec.goal), schedule)


async def answer_goal(
    session: Session, spec: Goal, status: GoalStatus, which: str, by: str = ""
) -> Goal:
    """Store, confirmed, which of the things that a goal's sentence can mean is meant.

    Raises:
        BadArgument: its sentence is plain, or `which` is no number or words of a candidate, nor
            `YES` where there is one.
    """
    candidates = status.candidates
    if not candidates:
        raise BadArgument(f"goal {spec.goal} does not ask anything: it is {status.state.value}")
    number = int(which) if which.isdecimal() else int(which == YES and not candidates[1:])
    meant = candidates[number - 1] if 1 <= number <= len(candidates) else which
    if meant not in candidates:
        listed = "; ".join(f"{i} ({words})" for i, words in enumerate(candidates, 1))
        raise BadArgument(f"{which!r} is none of what goal {spec.goal} can mean: {listed}")
    spec = replace(spec, meant=meant, said_by=by)
    schedule = await session.get(SCHEDULE_SPEC, ScheduleAddress(spec.goal))
    if schedule is not None:
        schedule = replace(schedule, goal=spec)
        await session.confirm(SCHEDULE_SPEC, ScheduleAddress(spec.goal), schedule)
    else:
        await session.confirm(GOAL_SPEC, GoalAddress(spec.goal), spec)
    return spec
