"""Which planner is in charge of a realm: one that takes the highest epoch there was, and keeps it.

The planner's status in the store says it, by compare and set: no two planners ever have the same
epoch. Robots refuse orders of a lower epoch than they have had. A store that was emptied says
neither; what a planner that goes on, or a robot that refuses, knows of epochs is then put right.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable

from msgspec.structs import replace

from fleet.errors import Superseded
from fleet.service.planning.messages import Ready
from keyexpr_schema.errors import StoreFull
from keyexpr_schema.full_disk import RETRY_S
from keyexpr_schema.keyspace import PLANNER_STATUS
from keyexpr_schema.payloads.system import (
    LARGEST_EPOCH,
    LARGEST_OVERTAKEN,
    PlannerAddress,
    PlannerStatus,
)
from keyexpr_schema.payloads.tasks import Report, ReportState
from keyexpr_schema.transport.session import Session

CHARGE_S = 3600.0
"""How long a planner that starts waits for a store."""

log = logging.getLogger(__name__)


class Charge:
    """The charge of one run of the planner; `epoch` is what its state has as its own."""

    def __init__(
        self,
        session: Session,
        incarnation: str,
        skills: tuple[str, ...],
        epoch: Callable[[], int],
    ) -> None:
        self._session, self._epoch = session, epoch
        self._own = PlannerStatus(epoch=0, incarnation=incarnation, skills=skills)
        self._fence = 0
        self._not_said = asyncio.Event()

    async def take(self) -> int:
        """Take the next epoch.

        What is there that is no status counts for nothing: it must not keep a planner from
        starting. Until the planning process says what it can do, what an earlier run could stands.
        """

        def next_epoch(status: PlannerStatus | None) -> PlannerStatus:
            known = (self._epoch(), status.epoch if status is not None else 0)
            return replace(
                status or self._own,
                # One more must be one that counts.
                epoch=1 + max((each for each in known if each < LARGEST_EPOCH), default=0),
                incarnation=self._own.incarnation,
                skills=self._own.skills,
            )

        ours = await self._update(next_epoch)
        return ours.epoch

    async def keep(
        self, ready: Callable[[], Awaitable[Ready]], raised: Callable[[int], None]
    ) -> None:
        """Say that this planner is in charge and what it can do, as soon as the planning process
        knows; again when the store says otherwise. `raised` hears of an epoch that is higher.

        Raises:
            Superseded: a planner with an epoch that is no lower is in charge.
        """
        can = await ready()
        self._own = replace(
            self._own,
            planners=tuple(can.planners_wait_s),
            strategies=can.strategies,
            allocators=tuple(can.allocators_wait_s),
        )
        while True:
            self._not_said.clear()
            ours = await self._update(self._with_own)
            if ours.epoch > self._epoch():
                raised(ours.epoch)
            await self._not_said.wait()

    def _with_own(self, status: PlannerStatus | None) -> PlannerStatus:
        if status is not None:
            self._stop_if_superseded(status)
        fence = self._fence + 1 if self._fence > self._epoch() else 0
        return replace(self._own, epoch=max(self._epoch(), fence))

    def status_changed(self, status: PlannerStatus | None) -> None:
        """What the store says of who is in charge.

        Raises:
            Superseded: a planner with an epoch that is no lower is.
        """
        if status is not None:
            self._stop_if_superseded(status)
        if status is None or status.incarnation != self._own.incarnation:
            self.not_said()

    def not_said(self) -> None:
        """The store does not say that this planner is in charge: it is to be said again."""
        self._not_said.set()

    def reported(self, report: Report) -> None:
        """A robot that has had orders of a higher epoch will do nothing until ours is higher."""
        known, fence = max(self._epoch(), self._fence), report.fence
        if report.state is ReportState.REFUSED and known < fence <= LARGEST_OVERTAKEN:
            self._fence = fence
            self._not_said.set()

    def _stop_if_superseded(self, status: PlannerStatus) -> None:
        other = status.incarnation != self._own.incarnation
        if other and self._epoch() <= _counted(status.epoch):
            raise Superseded(
                f"planner {status.incarnation} took charge of realm "
                f"{self._session.config.realm} (epoch {status.epoch}); this one stops"
            )

    async def _update(
        self, change: Callable[[PlannerStatus | None], PlannerStatus]
    ) -> PlannerStatus:
        said = False
        while True:
            try:
                return await self._session.update(
                    PLANNER_STATUS, PlannerAddress(), change, timeout_s=CHARGE_S
                )
            except StoreFull as full:
                if not said:
                    log.error("%s; nobody is in charge until then", full)
                    said = True
                await asyncio.sleep(RETRY_S)


def _counted(epoch: int) -> int:
    return epoch if epoch <= LARGEST_EPOCH else 0
