"""What is deployed where: noted on a key, and found there by who ends it or looks at it."""

from __future__ import annotations

import asyncio
import platform
import time
from typing import TYPE_CHECKING

from cli.client.presence import robot_alive
from cli.deployment.engines import Target
from cli.errors import NotDeployed, Refused, check_known
from keyexpr_schema.keyspace import DEPLOYMENT, ROBOT_ALIVE
from keyexpr_schema.payloads.deployments import Deployment
from keyexpr_schema.payloads.robots import RobotAddress

if TYPE_CHECKING:
    from cli.deployment.launch import Launch
    from keyexpr_schema.transport.session import Session


async def check_free(session: Session, robot: str) -> None:
    """That a robot is neither deployed nor has a worker otherwise: a second one would end.

    Raises:
        Refused: it is, or has.
    """
    record = await session.get(DEPLOYMENT, RobotAddress(robot))
    if record is not None:
        raise Refused(
            f"{robot} is deployed already, with {record.where}: `robotctl undeploy {robot}` first"
        )
    if await robot_alive(session, robot):
        raise Refused(
            f"{robot} has a worker already, and a second one would end: end that one first "
            "(`robotctl ps` shows those of `up`)"
        )


async def note(session: Session, what: Launch, target: Target, by: str) -> Deployment:
    """Say on its key that a robot is deployed."""
    record = Deployment(
        robot=what.robot,
        engine=target.engine,
        image=what.image,
        container=what.name,
        host=target.host,
        machine="" if target.host else platform.node(),
        by=by,
        since_s=time.time(),
    )
    await session.confirm(DEPLOYMENT, RobotAddress(what.robot), record)
    return record


async def find(session: Session, robot: str) -> tuple[Deployment, Target]:
    """Where a robot is deployed.

    Raises:
        Unknown: it is not.
        NotDeployed: it is on another machine, by that one's own engine.
    """
    known = {a.robot: each for a, each in (await session.list(DEPLOYMENT)).items()}
    check_known("deployed robot", robot, known, "`robotctl deploy ROBOT` deploys one")
    record = known[robot]
    target = Target(record.engine, record.host)
    if record.machine and record.machine != platform.node() and not target.in_a_cluster:
        raise NotDeployed(
            f"{robot} was deployed with {record.engine.value} on {record.machine}: give the "
            "command there"
        )
    return record, target


async def forget(session: Session, robot: str) -> None:
    """Say that a robot is not deployed any more."""
    await session.delete(DEPLOYMENT, RobotAddress(robot))


async def until_connected(session: Session, robot: str, wait_s: float) -> bool:
    """Whether a robot's worker comes to be connected within that time [s]."""
    async with session.watch_tokens(ROBOT_ALIVE, robot=robot) as watch:
        try:
            async with asyncio.timeout(wait_s):
                async for change in watch:
                    if change.alive:
                        return True
        except TimeoutError:
            pass
    return False
