"""Errors of the fleet package.

What goes wrong in the domain is a value; these are for what a caller or a user got wrong.
"""

from __future__ import annotations


class FleetError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class BadSkillFile(FleetError):
    """A skill model cannot be read; the message says which skill and field, and what is right."""


class BadLanguageFile(FleetError):
    """A file with words cannot be read; one sentence says which file, where and why."""


class BadTaskFile(FleetError):
    """A file with tasks cannot be read; one sentence says which file, task and key, and what is
    right."""


class BadLanguageConfig(FleetError):
    """Configuration of language is wrong; one sentence says where and why."""


class BadLlmConfig(FleetError):
    """Configuration or prompts of a language model are wrong; one sentence says where and why."""


class NotUnderstood(FleetError):
    """A sentence could not be turned into facts; the message says which words, and the choices."""


class StoreError(FleetError):
    """A store cannot be used; the message says why and what would help."""


class StoreInUse(StoreError):
    """Another process has this store open."""


class BadLease(FleetError):
    """A lease does not fit with how long a robot is waited for."""


class Superseded(FleetError):
    """Another planner with a higher epoch is in charge of this realm."""
