"""Errors of the simulation: what a caller of this package may have to handle."""

from __future__ import annotations


class SimError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class WorldRuns(SimError):
    """Another simulated world runs in the realm: robots of the same name would be in both."""


class BadFile(SimError):
    """A world, robot or mission file is missing or says something that cannot be."""


class NoStance(SimError):
    """There is nowhere for the robot to stand from which it can do what was asked."""


class NoPath(SimError):
    """There is somewhere to stand, and no way for the robot to get there."""
