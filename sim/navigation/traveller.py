"""One robot as traffic sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from sim.navigation.floor import Floor
from sim.navigation.spots import Dock

BRAKES_M = 0.3
"""Farther than any robot goes on while it brakes: 0.25 m at 0.6 m/s."""


@dataclass
class Traveller:
    """One robot as traffic sees it.

    `track` are the nodes from the last one reached to the end of what is promised; `corners[k]`
    what the step from `track[k]` to `track[k + 1]` cuts. `parked` is the stance it is at, leaves or
    enters; `goal` the node it wants to be at, `dock` the stance it wants to enter from there. A
    `static` one stays where it is, whoever asks; it may want nodes besides, `wanted`. `floor` is
    where it may drive. `since_s` is when
    it was sent; `ahead_m` is left of what it is promised: more is when that is `horizon_m` or less.
    """

    name: str
    radius_m: float
    floor: Floor
    track: list[int] = field(default_factory=list)
    corners: list[tuple[int, ...]] = field(default_factory=list)
    parked: Dock | None = None
    leaving: bool = False
    goal: int | None = None
    dock: Dock | None = None
    since_s: float = 0.0
    static: bool = False
    wanted: frozenset[int] = frozenset()
    claims: frozenset[int] = frozenset()
    ahead_m: float = 0.0
    horizon_m: float = math.inf

    @property
    def frontier(self) -> int:
        """The last node promised to it."""
        return self.track[-1]

    def give_up(self, at_m: Sequence[float], points_m: Sequence[Sequence[float]]) -> None:
        """Keep no more of its way than it needs to come to rest on, from where it is."""
        kept = 2
        while (
            kept < len(self.track)
            and math.dist(at_m[:2], points_m[self.track[kept - 1]]) < BRAKES_M
        ):
            kept += 1
        del self.track[kept:], self.corners[kept - 1 :]

    def recount(self) -> None:
        """Bring `claims` up to date after a change."""
        owned = set(self.track)
        for corner in self.corners:
            owned.update(corner)
        if self.parked is not None:
            owned |= self.parked.owned
        self.claims = frozenset(owned)
