"""What clauses that want something have in common: the ways in which things are brought about."""

from __future__ import annotations

from typing import NamedTuple

from fleet.language.resolve.goals.looking import Looking
from fleet.language.resolve.goals.moving import Moving
from fleet.language.resolve.goals.skilled import Skilled
from fleet.language.resolve.goals.tidiness import Tidiness
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground


class Deeds(NamedTuple):
    """Shared by all that turn the clauses of one reading into wishes."""

    ground: Ground
    wishes: Wishes
    moving: Moving
    looking: Looking
    skilled: Skilled
    tidiness: Tidiness


def deeds_of(ground: Ground) -> Deeds:
    """What can be brought about on that ground."""
    wishes = Wishes(ground)
    moving, looking = Moving(ground, wishes), Looking(ground, wishes)
    tidiness = Tidiness(ground, wishes, moving)
    return Deeds(ground, wishes, moving, looking, Skilled(ground), tidiness)
