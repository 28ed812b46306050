"""Leases: for how long a robot may move without hearing that its planner is in charge."""

from __future__ import annotations

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload


class LeaseQuery(Payload, frozen=True, kw_only=True):
    """Asks the planner for leases of these robots, each for the run of its worker that asks."""

    robots: dict[Id, Id]


class LeaseGrant(Payload, frozen=True, kw_only=True):
    """Which robots may move for how long [s], counted from when they were asked for.

    A robot that is missing gets none: its worker is not seen as connected, or the planner itself
    cannot say that it is in charge.
    """

    granted: dict[Id, float]
    epoch: int = 0
