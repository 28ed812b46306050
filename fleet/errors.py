"""Errors of the fleet package. What goes wrong in the domain is a value; these are for callers' mistakes."""

from __future__ import annotations


class FleetError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class BadSkillFile(FleetError):
    """A skill model cannot be read; the message says which skill, which line of it, and what is right."""


class NotUnderstood(FleetError):
    """A sentence could not be turned into facts; the message says which words, and what would be."""


class UnknownVariant(FleetError):
    """A planner, strategy or allocator of this name does not exist; the message lists those that do."""


class Superseded(FleetError):
    """Another planner with a higher epoch is in charge of this realm."""
