"""The world that a plan is checked against: as the fleet has it, or out of files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from cli.client.presence import robots_alive
from cli.errors import BadArgument, check_known
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, HOLDING, NOTHING, parse_literal
from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, ROBOT_SPEC
from keyexpr_schema.payloads.goals import Condition, Precedence
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


async def world_of_fleet(
    session: Session, skills: Mapping[str, SkillModel], only_connected: bool
) -> WorldModel:
    """Places, objects, robots and facts of the key-space; every robot counts as connected unless
    `only_connected`."""
    return WorldModel.of(
        skills,
        (await session.list(PLACE)).values(),
        (await session.list(OBJECT)).values(),
        (await session.list(ROBOT_SPEC)).values(),
        (await session.list(FACT)).values(),
        available=await robots_alive(session) if only_connected else None,
    )


def world_of_files(
    world: Path, robots: Iterable[Path], facts: Iterable[str], skills: Mapping[str, SkillModel]
) -> WorldModel:
    """Places and objects of a world file, robots of robot files, and only those facts.

    What a hand holds is known to be nothing, unless a fact says otherwise.

    Raises:
        BadFile: a file is not what it should be.
        BadArgument: a fact is not RELATION SUBJECT VALUE.
        Unknown: a fact's subject is nothing that there is.
    """
    from sim.files.robot_file import load_robot
    from sim.files.world_file import load_world
    from sim.files.world_payloads import object_payloads, place_payloads

    loaded = load_world(world)
    places, objects = place_payloads(loaded), object_payloads(loaded)
    specs = [load_robot(file) for file in robots]
    where = [*(place.place for place in places), *(spec.robot for spec in specs)]
    known = [parse_fact(fact) for fact in facts]
    for fact in known:
        things = [thing.object for thing in objects]
        subjects = [*where, *things]
        check_known("place, object or robot", fact.subject, subjects, "name it in a file")
        if fact.relation == AT and fact.value is not None:
            check_known("place, object or robot", str(fact.value), subjects, "name it in a file")
    return WorldModel.of(skills, places, objects, specs, [*_empty_hands(specs), *known])


def _empty_hands(specs: Iterable[RobotSpec]) -> list[Fact]:
    return [
        Fact(subject=spec.robot, relation=HOLDING, value=NOTHING, source="assumed")
        for spec in specs
        if "grip" in spec.capabilities
    ]


def parse_condition(written: str) -> Condition:
    """`is_open fridge false`, `is_open(fridge) = false` or `at(cup_1) != kitchen`.

    Raises:
        BadArgument: it is none of these.
    """
    negated = "!=" in written
    literal = parse_literal(written.replace("!=", "=", 1))
    if literal is None:
        raise BadArgument(
            "a condition is RELATION SUBJECT VALUE, such as 'is_open fridge false'; "
            f"got {written!r}"
        )
    (relation, subject), value = literal
    return Condition(relation=relation, subject=subject, value=value, negated=negated)


def parse_precedence(written: str) -> Precedence:
    """`at cup_1 sink before at cup_1 table`: if ever the second holds, the first did before.

    Raises:
        BadArgument: it is not that.
    """
    first, between, then = written.partition(" before ")
    if not between:
        raise BadArgument(
            "what must hold before something else is 'CONDITION before CONDITION', such as "
            f"'is_open fridge false before at cup_1 hallway'; got {written!r}"
        )
    return Precedence(first=parse_condition(first), then=parse_condition(then))


def parse_fact(written: str) -> Fact:
    """`at cup_1 kitchen` or `at(cup_1) = kitchen`.

    Raises:
        BadArgument: it is neither.
    """
    literal = parse_literal(written)
    if literal is None:
        raise BadArgument(
            f"a fact is RELATION SUBJECT VALUE, such as 'at cup_1 kitchen'; got {written!r}"
        )
    return Fact.of(literal, "person")
