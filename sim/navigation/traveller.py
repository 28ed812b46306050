"""One robot as traffic sees it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sim.navigation.floor import Floor
from sim.navigation.spots import Dock


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

    def recount(self) -> None:
        """Bring `claims` up to date after a change."""
        owned = set(self.track)
        for corner in self.corners:
            owned.update(corner)
        if self.parked is not None:
            owned |= self.parked.owned
        self.claims = frozenset(owned)
