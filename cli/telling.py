"""What robotctl tells the fleet: goals, statements, facts, places, objects; each confirmed."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from typing import TYPE_CHECKING

from cli.errors import BadArgument, Unknown, check_known
from cli.naming import free_name
from cli.presence import planner_alive
from keyexpr_schema.facts import AT, parse_value
from keyexpr_schema.keyspace import (
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    OBJECT,
    PLACE,
    PLANNER_STATUS,
    ROBOT_SPEC,
    ROBOT_STATE,
    SIM_CLOCK,
    SIM_SCENE,
    STATEMENT,
    STATEMENT_STATUS,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.service import PlannerAddress
from keyexpr_schema.payloads.world import (
    Fact,
    FactAddress,
    Object,
    ObjectAddress,
    Place,
    PlaceAddress,
    Statement,
    StatementAddress,
    StatementStatus,
)

if TYPE_CHECKING:
    from keyexpr_schema.payloads.robots import RobotSpec
    from keyexpr_schema.payloads.service import PlannerStatus
    from keyexpr_schema.transport.session import Session


CLOCK_S = 0.6
"""How long to listen for a simulation's clock [s, wall]; it ticks several times as often."""


READ_S = 5.0
"""How long the planner may take to read a statement."""


async def put_world(session: Session, places: Iterable[Place], objects: Iterable[Object]) -> None:
    """Store places and objects, confirmed."""
    for place in places:
        await session.confirm(PLACE, PlaceAddress(place.place), place)
    for thing in objects:
        await session.confirm(OBJECT, ObjectAddress(thing.object), thing)


async def add_statement(session: Session, text: str, name: str | None = None) -> Statement:
    """Store a sentence, confirmed, under `name` or one made from its words.

    Raises:
        BadArgument: it has no words.
    """
    if not text.strip():
        raise BadArgument("say something, such as “The first cup is in the kitchen.”")
    if name is None:
        stored = await session.list(STATEMENT)
        same = [a.statement for a, said in stored.items() if said.text == text]
        name = same[0] if same else free_name(text, (a.statement for a in stored), "statement")
    said = Statement(statement=name, text=text)
    await session.confirm(STATEMENT, StatementAddress(name), said)
    return said


async def statement_read(session: Session, statement: str) -> StatementStatus | None:
    """What the planner read out of a statement; `None` if no planner runs, or it does not say."""
    if not await planner_alive(session):
        return None
    with suppress(TimeoutError):
        async with (
            asyncio.timeout(READ_S),
            session.watch((STATEMENT_STATUS, {"statement": statement})) as watch,
        ):
            async for change in watch:
                if change.value is not None:
                    status: StatementStatus = change.value
                    return status
    return None


async def planner_status(session: Session) -> PlannerStatus | None:
    """What the latest planner says that it can do; `None` where none ever ran, or nobody can tell.

    A value that is no status is reported on its reject key, and is no reason to refuse a command.
    """
    return (await session.list(PLANNER_STATUS)).get(PlannerAddress())


async def check_skills(session: Session, specs: Iterable[RobotSpec]) -> None:
    """Do nothing if the planner has a model of each skill, or if no planner ever ran here.

    Raises:
        Unknown: it lacks one, so that no plan could ever ask a robot for it.
    """
    planner = await planner_status(session)
    if planner is None or not planner.skills:
        return
    for spec in specs:
        for skill in spec.skills:
            if skill not in planner.skills:
                near = get_close_matches(skill, planner.skills, n=1)
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise Unknown(
                    f"robot {spec.robot!r}: the planner knows no skill {skill!r}{hint}; it knows "
                    f"{', '.join(sorted(planner.skills))}; "
                    "teach it more with `robotctl planner --skills FILE`"
                )


async def add_fact(session: Session, relation: str, subject: str, written: str) -> Fact:
    """Store a fact, confirmed.

    Raises:
        Unknown: `at` of something that is no object or robot, or of a place that is none.
    """
    value = parse_value(written)
    if relation == AT:
        how = "load a world with `robotctl world load FILE`"
        robots = [a.robot for a in await session.list(ROBOT_SPEC)]
        objects = [a.object for a in await session.list(OBJECT)]
        check_known("object or robot", subject, [*objects, *robots], how)
        if value is not None:
            places = [a.place for a in await session.list(PLACE)]
            check_known("place or robot", written, [*places, *robots], how)
    fact = Fact(
        subject=subject,
        relation=relation,
        value=value,
        source="person",
        time_s=await fleet_time_s(session),
    )
    await session.confirm(FACT, FactAddress.of(fact.key), fact)
    return fact


async def fleet_time_s(session: Session) -> float:
    """The time that a fact said now carries [s]: a simulation's clock if there is one, else Unix.

    A realm that has a simulated scene whose clock is not heard has stopped; then the time is the
    latest that a robot has told, since Unix time would outdate whatever the simulation says later.
    """
    heard: float | None = None
    simulated = False
    async with session.watch(SIM_CLOCK, SIM_SCENE) as watch:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOCK_S):
                async for change in watch:
                    if change.key is SIM_CLOCK and change.value is not None:
                        heard = change.value.time_s
                        break
                    simulated = simulated or change.value is not None
    if heard is not None:
        return heard
    if not simulated:
        return time.time()
    states = (await session.list(ROBOT_STATE)).values()
    return max((state.time_s for state in states), default=0.0)


async def put_goal(
    session: Session,
    text: str,
    name: str | None,
    priority: int = 0,
    within_s: float | None = None,
) -> Goal:
    """Store a goal, confirmed, after all that were given before it; due `within_s` from now [s].

    Raises:
        BadArgument: it has no words, or there is a goal of that name.
    """
    if not text.strip():
        raise BadArgument("say what you want, such as “Bring the first cup to the hallway.”")
    stored = {address.goal: spec for address, spec in (await session.list(GOAL_SPEC)).items()}
    ended = [address.goal for address in await session.list(GOAL_STATUS)]
    if name in stored:
        raise BadArgument(
            f"there is a goal {name!r} already: “{stored[name].text}”; use another --id"
        )
    spec = Goal(
        goal=name if name is not None else free_name(text, [*stored, *ended], "goal"),
        text=text,
        priority=priority,
        due_s=None if within_s is None else await fleet_time_s(session) + within_s,
        ordinal=1 + max((each.ordinal for each in stored.values()), default=0),
    )
    await session.confirm(GOAL_SPEC, GoalAddress(spec.goal), spec)
    return spec
