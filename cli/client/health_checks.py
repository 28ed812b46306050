"""Whether a process of the fleet is well, asked from outside in one go: for `robotctl health`.

Each check says so in a sentence, and whether it helps to start the process again. A line that is
cut, a full disk or a clock that is off stay as they are, and a robot's worker that is started again
for that loses what it was at.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from cli.client.health import diagnostics
from cli.client.planner_requests import planner_status
from cli.client.presence import planners_alive, recorders_alive, robot_alive, sims_alive
from cli.views.text import counted
from keyexpr_schema.errors import NoReply, SchemaError
from keyexpr_schema.keyspace import DIAGNOSTIC, LEASE, PLANNER_STATUS, ROBOT_SPEC, ROBOT_STATE
from keyexpr_schema.payloads.leases import LeaseQuery
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.system import PlannerAddress

if TYPE_CHECKING:
    from keyexpr_schema.payloads.leases import LeaseGrant
    from keyexpr_schema.transport.session import Session

ROUTER, PLANNER, WORKER, RECORDER, SIM = ROLES = ("router", "planner", "worker", "recorder", "sim")
ASK_S = 2.0


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """How one process is; `restart_helps`: it is not well, and may be when it is started again."""

    process: str
    well: bool
    said: str
    restart_helps: bool = False


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """How all that were asked for are."""

    well: bool
    findings: tuple[Finding, ...]

    @classmethod
    def of(cls, findings: Iterable[Finding]) -> Verdict:
        """Of all; well where each is."""
        found = tuple(findings)
        return cls(well=all(each.well for each in found), findings=found)

    @property
    def restart_helps(self) -> bool:
        """Whether one of them may be well when it is started again."""
        return any(each.restart_helps for each in self.findings)

    @property
    def line(self) -> str:
        """All in a line: what is wrong, or else what is well."""
        told = [each for each in self.findings if each.well is self.well]
        return f"{'well' if self.well else 'NOT WELL'}: {'; '.join(each.said for each in told)}"


@dataclass(frozen=True)
class Asked:
    """Who is asked about: a role, `None` for the whole fleet; of workers which `robots` (none: all
    that are registered). `store`: whether a router must have a store behind it."""

    role: str | None = None
    robots: tuple[str, ...] = ()
    store: bool = True

    @property
    def component(self) -> str:
        """As whom it is asked, so that what a process may see by its own certificate will do."""
        if self.role == WORKER and len(self.robots) == 1:
            return f"worker-{self.robots[0]}"
        return self.role if self.role in (PLANNER, RECORDER, SIM) else "robotctl"

    @property
    def processes(self) -> str:
        """Their names, for a sentence."""
        return " and ".join(self.robots) or self.role or "fleet"


def unreached(asked: Asked, said: str) -> Finding:
    """That nobody could be asked, which a router can be blamed for, and nobody else."""
    return Finding(
        process=asked.processes, well=False, said=said, restart_helps=asked.role == ROUTER
    )


async def look(session: Session, asked: Asked) -> Verdict:
    """How those that are asked about are now.

    Raises:
        SchemaError: it could not be found out.
    """
    if asked.role is None:
        every = (router(session), planner(session), _every_worker(session), _others(session))
        return Verdict.of(each for found in await asyncio.gather(*every) for each in found)
    checks: dict[str, Callable[[], Awaitable[Iterable[Finding]]]] = {
        ROUTER: lambda: router(session, asked.store),
        PLANNER: lambda: planner(session),
        WORKER: lambda: _workers(session, asked.robots),
        RECORDER: lambda: recorder(session),
        SIM: lambda: sim(session),
    }
    return Verdict.of(await checks[asked.role]())


async def router(session: Session, store: bool = True) -> list[Finding]:
    """A router that lets us in, whose store has answered for writes just now."""
    where = ", ".join(session.config.endpoints)
    if not store:
        return [Finding(process=ROUTER, well=True, said=f"the router at {where} answers")]
    try:
        if session.clock.latest is None:  # none of ours; a zenohd's storage answers when read
            await session.get(PLANNER_STATUS, PlannerAddress(), ASK_S)
        failing = (await session.store_troubles(ASK_S)).failing
    except SchemaError as error:
        return [Finding(process=ROUTER, well=False, said=str(error), restart_helps=True)]
    if failing is not None:
        return [Finding(process=ROUTER, well=False, said=failing)]
    return [Finding(process=ROUTER, well=True, said=f"the store answers at {where}")]


async def planner(session: Session) -> list[Finding]:
    """A planner that is connected, is in charge by the store's word, and answers itself."""
    status, alive = await asyncio.gather(planner_status(session), planners_alive(session))

    def unwell(said: str) -> list[Finding]:
        return [Finding(process=PLANNER, well=False, said=said, restart_helps=True)]

    if not alive:
        return unwell("no planner is connected")
    if status is None or status.incarnation not in alive:
        return unwell("a planner is connected, and is not in charge")
    try:
        # Of no robot: it shows only that somebody answers, and knows that it is in charge.
        answer: LeaseGrant = await session.query(
            LEASE, PlannerAddress(), LeaseQuery(robots={}), ASK_S
        )
    except NoReply:
        return unwell("the planner is connected, and does not answer")
    if answer.epoch not in (0, status.epoch):
        return unwell(
            f"the planner that answers has epoch {answer.epoch}, and {status.epoch} is in charge"
        )
    said = f"the planner is in charge (epoch {status.epoch}) and answers"
    return await _diagnosed(session, PLANNER, said)


async def recorder(session: Session) -> list[Finding]:
    """A recorder that is connected and writes."""
    if await recorders_alive(session):
        return await _diagnosed(session, RECORDER, "the recorder is connected")
    said = "no recorder is connected"
    return [Finding(process=RECORDER, well=False, said=said, restart_helps=True)]


async def sim(session: Session) -> list[Finding]:
    """A simulated world that is connected. One that is started again begins anew."""
    there = bool(await sims_alive(session))
    said = f"{'the' if there else 'no'} simulated world is connected"
    return [Finding(process=SIM, well=there, said=said, restart_helps=not there)]


async def _workers(session: Session, robots: tuple[str, ...]) -> list[Finding]:
    named = robots or sorted(a.robot for a in await session.list(ROBOT_SPEC))
    return list(await asyncio.gather(*(_worker(session, robot) for robot in named)))


async def _every_worker(session: Session) -> list[Finding]:
    """Of those that are not well, each; else only how many there are."""
    found = await _workers(session, ())
    if unwell := [each for each in found if not each.well]:
        return unwell
    said = f"{counted(len(found), 'worker')} connected" if found else "no robot is registered"
    return [Finding(process="workers", well=True, said=said)]


async def _worker(session: Session, robot: str) -> Finding:
    """A worker that the router has heard of within the link's lease, and that can work."""
    address = RobotAddress(robot)
    connected, state = await asyncio.gather(
        robot_alive(session, robot), session.get(ROBOT_STATE, address, ASK_S)
    )
    if not connected:
        if await session.get(ROBOT_SPEC, address, ASK_S) is None:
            return Finding(
                process=robot,
                well=False,
                said=f"{robot} is not registered, and a worker of it waits for that",
            )
        said = f"the worker of {robot} is not connected"
        return Finding(process=robot, well=False, said=said, restart_helps=True)
    if state is not None and state.trouble is not None:
        return Finding(process=robot, well=False, said=f"{robot}: {state.trouble}")
    doing = (
        "" if state is None else ", emergency stop" if state.stops else f", {state.activity.value}"
    )
    return Finding(process=robot, well=True, said=f"the worker of {robot} is connected{doing}")


async def _diagnosed(session: Session, component: str, said: str) -> list[Finding]:
    """Well, unless it says itself that it is not."""
    wrong = (await session.list(DIAGNOSTIC, ASK_S, component=component)).values()
    if not wrong:
        return [Finding(process=component, well=True, said=said)]
    return [Finding(process=component, well=False, said=each.sentence) for each in wrong]


async def _others(session: Session) -> list[Finding]:
    """Recorder and simulated world, where there are some, and what is wrong with them."""
    there = await asyncio.gather(recorder(session), sim(session))
    return [
        *(each for found in there for each in found if each.well),
        *(await _troubles(session)),
    ]


async def _troubles(session: Session) -> list[Finding]:
    return [
        Finding(process=each.component, well=False, said=f"{each.component}: {each.sentence}")
        for each in await diagnostics(session)
        if each.component not in (ROUTER, PLANNER)
    ]
