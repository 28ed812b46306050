"""Plug-ins: what installed packages offer as entry points in one of RobotFleet's groups.

A plug-in is somebody else's code. One that cannot be used costs a warning that names its package
and entry point, and nothing else: all others are loaded.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Any, TypeVar

from keyexpr_schema.errors import BrokenPlugIn

T = TypeVar("T")

_log = logging.getLogger("robotfleet.plug_ins")


def plug_in_names(group: str) -> tuple[str, ...]:
    """The names of the entry points in `group`, sorted; nothing is imported."""
    return tuple(sorted(entry_points(group=group).names))


def load_plug_in(group: str, name: str, accept: Callable[[Any], T]) -> T:
    """What the entry point `name` of `group` offers, as `accept` makes it of the loaded object.

    Raises:
        BrokenPlugIn: there is none of that name, it does not load, or `accept` raised.
    """
    for entry in entry_points(group=group, name=name):
        return _load(entry, accept)
    known = ", ".join(plug_in_names(group)) or "none"
    raise BrokenPlugIn(f"no installed package offers {name!r} in {group}; there are {known}")


def load_plug_ins(group: str, accept: Callable[[Any], T]) -> list[T]:
    """What `accept` makes of every entry point of `group`; broken ones are logged and left out."""
    found = []
    for entry in entry_points(group=group):
        try:
            found.append(_load(entry, accept))
        except BrokenPlugIn as error:
            _log.warning("%s", error)
    return found


def _load(entry: EntryPoint, accept: Callable[[Any], T]) -> T:
    try:
        return accept(entry.load())
    except (Exception, SystemExit) as error:  # whatever a stranger's import or constructor raises
        package = "a package" if entry.dist is None else f"package {entry.dist.name}"
        raise BrokenPlugIn(
            f"{package} offers {entry.value} as {entry.name!r} in {entry.group}, which cannot be "
            f"used: {type(error).__name__}: {error}"
        ) from error
