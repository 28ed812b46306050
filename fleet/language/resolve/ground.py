"""What all that resolve clauses stand on: the scene, and who, what and where can be meant in it."""

from __future__ import annotations

from typing import NamedTuple

from fleet.language.resolve.location.places import PlaceResolver
from fleet.language.resolve.reference.nouns import NounResolver
from fleet.language.resolve.reference.referents import Referents
from fleet.language.resolve.scene import Scene


class Ground(NamedTuple):
    """Shared by all that resolve the clauses of one reading."""

    scene: Scene
    who: Referents
    nouns: NounResolver
    places: PlaceResolver


def ground_of(scene: Scene) -> Ground:
    """Noun phrases and phrases of place, resolved in that scene."""
    who = Referents(scene)
    nouns = NounResolver(scene, who)
    return Ground(scene, who, nouns, PlaceResolver(scene, who, nouns))
