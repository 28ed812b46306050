"""A worker as a process: `run_worker` is the main function of `robotctl worker`."""

from __future__ import annotations

import asyncio
import logging
import secrets
import sys
from collections.abc import Iterable
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from pathlib import Path

from keyexpr_schema.ids import check_id
from keyexpr_schema.keyspace import ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.signals import run_until_signal
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from workers.embodiment import Embodiment, EmbodimentFactory
from workers.orders.journal import Journal
from workers.runtime import Worker
from workers.skill_registry import Skill, SkillRegistry
from workers.skills.household import HOUSEHOLD

WAITING_LINE_S = 1.0
"""Wall seconds of waiting for a robot to be registered before it is announced."""


def run_worker(
    robot: str,
    endpoints: tuple[str, ...],
    realm: str,
    data_dir: Path,
    embodiment_factory: EmbodimentFactory,
    *,
    skills: Iterable[Skill] = HOUSEHOLD,
) -> None:
    """Be the worker of `robot` until SIGTERM or SIGINT; then stop the robot and return.

    Waits for a router, and for the robot's spec to be registered. Skills are `skills` and those
    that installed packages offer (see `SkillRegistry.installed`). The order journal is
    `data_dir/{robot}.journal`. Logs go to stderr; the line `worker {robot} ready (incarnation …)`
    to stdout.

    Raises:
        InvalidId: `robot` or `realm` cannot stand in a key.
        JournalBusy: another worker runs for this robot on the same `data_dir`.
        JournalUnreadable: the journal's file is something else.
        BadSkill: two of `skills` share a name.
    """
    check_id(robot, "robot")
    config = SessionConfig(
        endpoints=endpoints,
        realm=realm,
        component=f"worker-{robot}",
        connect_timeout_s=None,
    )
    logging.basicConfig(
        stream=sys.stderr, level=logging.INFO, format=f"{robot}: %(levelname)s: %(message)s"
    )
    registry = SkillRegistry.installed(skills)
    with Journal(data_dir / f"{robot}.journal") as journal:
        run_until_signal(_work(robot, config, journal, registry, embodiment_factory))


async def _work(
    robot: str,
    config: SessionConfig,
    journal: Journal,
    registry: SkillRegistry,
    embodiment_factory: EmbodimentFactory,
) -> None:
    async with AsyncExitStack() as stack:
        session = await stack.enter_async_context(open_session(config))
        spec = await _registered(session, robot)
        incarnation = f"{robot[:40]}-{secrets.token_hex(4)}"
        made = embodiment_factory(session, spec, incarnation)
        body: Embodiment = (
            await stack.enter_async_context(made)
            if isinstance(made, AbstractAsyncContextManager)
            else made
        )
        worker = Worker(session, spec, body, journal, registry, incarnation)
        announcing = asyncio.create_task(_announce_ready(worker))
        try:
            await worker.run()
        finally:
            announcing.cancel()


async def _registered(session: Session, robot: str) -> RobotSpec:
    """The robot's spec, as soon as somebody has registered it."""

    async def first() -> RobotSpec:
        async with session.watch((ROBOT_SPEC, {"robot": robot})) as watch:
            async for change in watch:
                if change.value is not None:
                    return change.value  # type: ignore[no-any-return]
        raise AssertionError("a watch does not end")

    finding = asyncio.create_task(first())
    try:
        done, _ = await asyncio.wait({finding}, timeout=WAITING_LINE_S)
        if not done:
            print(f"worker {robot} waits: the robot is not registered yet", flush=True)  # noqa: T201
        return await finding
    finally:
        finding.cancel()


async def _announce_ready(worker: Worker) -> None:
    await worker.ready()
    print(f"worker {worker.spec.robot} ready (incarnation {worker.incarnation})", flush=True)  # noqa: T201
