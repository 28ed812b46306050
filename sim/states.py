"""How things are: switches, doors of a world without physics, and what processes do to things."""

from __future__ import annotations

from collections.abc import Callable, Collection

from keyexpr_schema.facts import IS_ON, IS_OPEN, Value
from sim.files.world_schema import WorldFile

Contents = Callable[[str], Collection[str]]
"""The things that are directly on or in a thing."""


class ThingStates:
    """The states of all things, by thing and relation, beginning with those of the world file.

    Heat and water are no part of the simulated worlds. What an appliance does is a process: when
    it has been on, and closed if it can be, for `after_s` with a thing in it or on it all the
    while, that thing's state is what the world file says.
    """

    def __init__(self, world: WorldFile) -> None:
        self._values: dict[str, dict[str, Value]] = {
            thing: dict(states) for thing, states in world.states.items()
        }
        for thing in world.fixtures.movers:
            self._values.setdefault(thing, {}).setdefault(IS_OPEN, False)
        for thing in world.fixtures.buttons:
            self._values.setdefault(thing, {}).setdefault(IS_ON, False)
        self._processes = {
            name: entry.process for name, entry in world.furniture.items() if entry.process
        }
        self._since: dict[tuple[str, str], float] = {}

    def of(self, thing: str) -> dict[str, Value]:
        """All states of a thing."""
        return dict(self._values.get(thing, {}))

    def get(self, thing: str, state: str) -> Value:
        """One state of a thing; `None` if it has no such state."""
        return self._values.get(thing, {}).get(state)

    def set(self, thing: str, state: str, value: Value) -> None:
        """Change one state."""
        self._values.setdefault(thing, {})[state] = value

    @property
    def processing(self) -> bool:
        """Whether any appliance is at work, so that `advance` has something to do."""
        return any(self.get(name, IS_ON) is True for name in self._processes) or bool(self._since)

    def advance(self, time_s: float, contents: Contents) -> None:
        """Let the processes go on until `time_s`."""
        since = {}
        for name, process in self._processes.items():
            if self.get(name, IS_ON) is not True or self.get(name, IS_OPEN) is True:
                continue
            for thing in contents(name):
                begun_s = since[(name, thing)] = self._since.get((name, thing), time_s)
                if time_s - begun_s >= process.after_s:
                    self.set(thing, process.state, process.value)
        self._since = since
