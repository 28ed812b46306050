"""Errors of the simulation: what a caller of this package may have to handle."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import SequenceMatcher

MOST_NAMES = 5
"""A large world has thousands; nobody reads them all in a sentence."""


class SimError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class WorldRuns(SimError):
    """Another simulated world runs in the realm: robots of the same name would be in both."""


class BadFile(SimError):
    """A world, robot or mission file is missing or says something that cannot be."""


class NoWay(SimError):
    """A robot cannot get to where it can do what was asked.

    `blocked_by` is the thing but for which it could, were that closed.
    """

    def __init__(self, sentence: str, blocked_by: str | None = None) -> None:
        super().__init__(sentence)
        self.blocked_by = blocked_by


class NoStance(NoWay):
    """There is nowhere for the robot to stand from which it can do what was asked."""


class NoPath(NoWay):
    """There is somewhere to stand, and no way for the robot to get there."""


def there_are(names: Iterable[str], wanted: str, none: str = "none") -> str:
    """What there is in place of `wanted`, for a sentence: of many names the nearest."""
    several = list(names)
    if len(several) > MOST_NAMES:
        like = {name: SequenceMatcher(None, wanted, name).ratio() for name in several}
        several = [*sorted(several, key=lambda name: -like[name])[:MOST_NAMES], "…"]
    return f"there are {', '.join(several) or none}"
