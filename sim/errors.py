"""Errors of the simulation: what a caller of this package may have to handle."""

from __future__ import annotations


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
