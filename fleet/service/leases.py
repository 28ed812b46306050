"""Leases that the planner gives: a robot moves only while it can hear who is in charge.

What a robot was to do goes to others when its worker has been away for `lost_after_s`. By then the
robot must be at rest, whatever it can hear. So a lease is given only

- to a run of a worker that is seen as connected: none is given once it counts as away, and
- while the store has confirmed, not longer than `CHARGE_S` ago, that this planner is in charge: one
  that is cut off together with some robots may have been replaced by another one.

Both count from when something was asked, on clocks that nobody sets (`check_lease`).
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from fleet.errors import BadLease
from keyexpr_schema.errors import SchemaError, UndecodablePayload
from keyexpr_schema.keyspace import PLANNER_STATUS
from keyexpr_schema.payloads.leases import LeaseGrant, LeaseQuery
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.transport.session import Session

LEASE_S = 8.0
"""How long a robot goes on that hears nothing [s], unless it is configured."""
CHARGE_S = 4.0
"""How long the store's word that this planner is in charge counts [s]."""
STOPPING_S = 8.0
"""How long a robot takes to come to rest when its lease has run out [s]: one that its worker cannot
reach is stopped by its driver's own watchdog (that of the simulation within 7 s)."""
ASK_S = 1.0
"""Between two questions to the store [s], each of which may be lost, where leases are given."""
SELDOM_S = 20.0
"""The same where none are: a status that nobody can read is replaced all the same."""


def check_lease(lease_s: float, lost_after_s: float) -> None:
    """That a robot is at rest before what it was to do is given to others.

    Raises:
        BadLease: it might not be.
    """
    needed_s = lease_s + CHARGE_S + STOPPING_S
    if lease_s > 0.0 and lost_after_s < needed_s:
        longest_s = lost_after_s - CHARGE_S - STOPPING_S
        shorter = f"a lease of {longest_s:g} s at most, or " if longest_s > 0.0 else ""
        raise BadLease(
            f"a robot that is lost after {lost_after_s:g} s may still move: with a lease of "
            f"{lease_s:g} s it is at rest after {needed_s:g} s; give {shorter}at least "
            f"{needed_s:g} s for lost-after (a lease of 0: nothing stops robots that are cut off)"
        )


class Leases:
    """The leases of one run of the planner, which is `incarnation`, of `lease_s` each.

    `not_said` hears that the store does not say that this planner is in charge.
    """

    def __init__(
        self, session: Session, incarnation: str, lease_s: float, not_said: Callable[[], None]
    ) -> None:
        self._session, self._incarnation, self._lease_s = session, incarnation, lease_s
        self._not_said = not_said
        self._connected: set[tuple[str, str]] = set()
        self._in_charge_until_s = 0.0
        self.epoch = 0

    def seen(self, robot: str, incarnation: str, alive: bool) -> None:
        """A run of a robot's worker came, or went away: from now on it gets no lease."""
        change = self._connected.add if alive else self._connected.discard
        change((robot, incarnation))

    async def keep_charge(self) -> None:
        """Ask the store for ever whether this planner is in charge.

        A watch tells who else says so, but not what is no status at all, and nobody would give
        leases, or know what the planner can do, as long as that is there.
        """
        pause_s = ASK_S if self._lease_s > 0.0 else SELDOM_S
        while True:
            asked_s = time.monotonic()
            try:
                status = await self._session.get(PLANNER_STATUS, PlannerAddress())
            except UndecodablePayload:
                self._not_said()
            except SchemaError:
                pass  # the store does not answer
            else:
                if status is not None and status.incarnation == self._incarnation:
                    self.epoch = status.epoch
                    self._in_charge_until_s = asked_s + CHARGE_S
            await asyncio.sleep(pause_s)

    async def give(self, _: PlannerAddress, asked: LeaseQuery) -> LeaseGrant:
        """The answer to a worker."""
        if time.monotonic() >= self._in_charge_until_s:
            return LeaseGrant(granted={}, epoch=self.epoch)
        known = {r: self._lease_s for r, run in asked.robots.items() if (r, run) in self._connected}
        return LeaseGrant(granted=known, epoch=self.epoch)
