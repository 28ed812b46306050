"""Errors of the command line: each is one sentence for a person, and ends robotctl with 1."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class CliError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class BadSettings(CliError):
    """A configuration file or an environment variable says something that makes no sense."""


class BadFile(CliError):
    """A file that was named cannot be read or is not what it should be."""


class BadArgument(CliError):
    """An argument is well-formed for the shell but cannot mean anything here."""


class BadCertificates(CliError):
    """A certificate authority, or what it has made, cannot be used."""


class Unknown(CliError):
    """A name that nobody has declared; the message lists the ones that were."""


class NotRunning(CliError):
    """A part of the fleet that this command needs is not there."""


class Refused(CliError):
    """The planner answered no; the message is its reason."""


class ProcessDied(CliError):
    """A process of a demo ended by itself; the message names it and its log."""


class NotDeployed(CliError):
    """A container could not be run, ended or looked at; the message says where, and why."""


class TooLate(CliError):
    """Something was waited for and did not happen before the deadline."""


HOW_TO_ADD = {
    "goal": "say one with `robotctl goal add`",
    "plan": "make one with `robotctl plan create`",
    "robot": "declare one with `robotctl register FILE`",
    "place": "tell one with `robotctl world add --place`",
}
"""Where there is none of a kind yet: how there comes to be one."""
OVER = "what is over is in `robotctl history`"
ENDS = frozenset(
    {"goal", "plan", "goal or plan", "plan that goes on", "schedule or goal for later"}
)
"""Kinds of which one that nobody knows may have been there, long ago."""


def check_known(what: str, name: str, known: Iterable[str], how_to_add: str = "") -> None:
    """Do nothing if `name` is one of `known`.

    Raises:
        Unknown: it is not; the message suggests a near miss, lists valid names (five at most, the
            nearest first), or says how to declare the first one (`how_to_add`, else by
            `HOW_TO_ADD`), and of a kind that `ENDS` where it may have gone.
    """
    from fleet.language.refusals import nearest

    names = sorted(set(known))
    if name in names:
        return
    gone = f"; {OVER}" if what in ENDS else ""
    if not names:
        how_to_add = how_to_add or HOW_TO_ADD.get(what, "")
        how = f"; {how_to_add}" if how_to_add else ""
        raise Unknown(f"there is no {what} {name!r}: there is none now{how}{gone}")
    known_are = nearest(names, name)
    near = near_miss(name, names)
    raise Unknown(f"there is no {what} {name!r}{near}; known are: {known_are}{gone}")


def near_miss(name: str, names: Iterable[str]) -> str:
    """` (did you mean …?)`, where one of `names` is nearly `name`."""
    near = get_close_matches(name, names, n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""
