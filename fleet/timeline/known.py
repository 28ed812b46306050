"""What the recorder knows of the keys: what there is now, and of what is over only the latest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from keyexpr_schema.keyspace import GOAL_STATUS, PLAN_STATUS
from keyexpr_schema.payloads.goals import ENDED_GOALS
from keyexpr_schema.payloads.plans import ENDED_PLANS

Name = tuple[str, Any]
"""Name of a key and an address of it."""

KEPT = {"plan": 6, "goal": 64, "digest": 64}
"""How many plans, goals and rejects are remembered that are over, or of which nobody said that
they go on. Those that go on all are."""


@dataclass
class _Group:
    """The values of one plan, goal or reject."""

    goes_on: bool = False
    names: set[Name] = field(default_factory=set)


class Known:
    """The newest value of each key, as long as it can matter."""

    def __init__(self) -> None:
        self._values: dict[Name, Any] = {}
        self._groups: dict[str, dict[str, _Group]] = {kind: {} for kind in KEPT}
        self._over = dict.fromkeys(KEPT, 0)

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[tuple[Name, Any]]:
        return iter(tuple(self._values.items()))

    def get(self, name: Name) -> Any:
        """The value, or `None`."""
        return self._values.get(name)

    def put(self, name: Name, value: Any) -> None:
        """This is the value now; `None`: it was deleted."""
        group = self._group(name, make=value is not None)
        if value is None:
            self._values.pop(name, None)
            if group is not None:
                group.names.discard(name)
                self._tell(name, group, False)
        else:
            self._values[name] = value
            if group is not None:
                group.names.add(name)
                self._tell(name, group, _goes_on(name[0], value))

    def forget(self) -> list[str]:
        """Let go of the oldest that are over where there are more than are kept; their plans."""
        gone: list[str] = []
        for kind, kept in KEPT.items():
            groups = self._groups[kind]
            while self._over[kind] > kept:
                oldest = next(one for one, group in groups.items() if not group.goes_on)
                for name in groups.pop(oldest).names:
                    del self._values[name]
                self._over[kind] -= 1
                if kind == "plan":
                    gone.append(oldest)
        return gone

    def _group(self, name: Name, make: bool) -> _Group | None:
        for kind, groups in self._groups.items():
            one = getattr(name[1], kind, None)
            if one is not None:
                if one not in groups and make:
                    groups[one] = _Group()
                    self._over[kind] += 1
                return groups.get(one)
        return None

    def _tell(self, name: Name, group: _Group, goes_on: bool) -> None:
        """Only the status says whether it goes on."""
        kind = {PLAN_STATUS.name: "plan", GOAL_STATUS.name: "goal"}.get(name[0])
        if kind is not None and group.goes_on != goes_on:
            group.goes_on = goes_on
            self._over[kind] += -1 if goes_on else 1


def _goes_on(key: str, value: Any) -> bool:
    if key == PLAN_STATUS.name:
        return value.state not in ENDED_PLANS
    return key == GOAL_STATUS.name and value.state not in ENDED_GOALS
