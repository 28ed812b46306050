"""Who takes part in a fleet, by the name in a certificate, and which keys are for whom.

`robot.hsr`, `operator.ana`, `planner`, `recorder`, `sim`, `workers`, `router.main` are common names
of certificates. Without certificates a session goes by its component, which is what it says.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from keyexpr_schema.authors import Names
from keyexpr_schema.key import Component, Key
from keyexpr_schema.keyspace import KEY_TREES, STORE_REPLACE
from keyexpr_schema.payloads.world import PERSON_SOURCE

ROUTER, OPERATOR = "router", "operator"
"""What the common names of routers and of people begin with."""

_WORKER = Component.WORKER | Component.OWN_WORKER
_SERVICES = {
    "planner": Component.PLANNER,
    "recorder": Component.RECORDER,
    "sim": Component.SIMULATION,
}


@dataclass(frozen=True)
class Principal:
    """One who takes part, by `name`. Of `robot` are the keys that are for the worker of the robot
    that they name; `None` with such a role: of every robot."""

    name: str
    roles: Component
    robot: str | None = None

    @classmethod
    def of(cls, name: str) -> Principal:
        """Who goes by a common name, or by a component's; who is nothing else is a person."""
        if name in _SERVICES:
            return cls(name, _SERVICES[name])
        kind, _, robot = name.partition(".")
        if kind == "robot" and robot:
            return cls(name, _WORKER, robot)
        kind, _, robot = name.partition("-")
        if kind == "worker" and robot:
            return cls(name, _WORKER, robot)
        return cls(name, _WORKER if kind == "workers" else Component.PERSON)

    @classmethod
    def certified(cls, name: str) -> Principal | None:
        """Who goes by a certificate's common name; `None`: a router, or nobody of the fleet."""
        kind, _, own = name.partition(".")
        named_kind = kind in ("robot", OPERATOR) and own != ""
        alone = name in _SERVICES or name == "workers"
        return cls.of(name) if named_kind or alone else None

    @property
    def author(self) -> str | None:
        """The name by which a person with a certificate says things; `None`: it is of no person."""
        kind, _, own = self.name.partition(".")
        return own if kind == OPERATOR and own else None

    def writes(self, key: Key[Any, Any]) -> str | None:
        """The key expression of what it may write of a key; `None`: nothing."""
        fields, own = key.address.__struct_fields__, {}
        if key is STORE_REPLACE:
            own["asker"] = self.name
        elif "component" in fields and (signature := self._signature) is not None:
            own["component"] = signature
        return self._pattern(key, key.writers, own)

    def puts_back(self, key: Key[Any, Any]) -> str | None:
        """The key expression of what it may put of others', and not delete, because a store may
        have lost it; `None`: nothing."""
        return key.pattern() if key.put_back and self.roles & Component.PLANNER else None

    def reads(self, key: Key[Any, Any]) -> str | None:
        """The key expression of what it may read of a key; `None`: nothing."""
        return self._pattern(key, key.readers, {})

    def objection_to_write(self, key: Key[Any, Any], keyexpr: str) -> str | None:
        """Why it may not write a key expression of that key; `None`: it may."""
        if _includes(self.puts_back(key), keyexpr):
            return None
        return self._objection_to_own(key, keyexpr)

    def _objection_to_own(self, key: Key[Any, Any], keyexpr: str) -> str | None:
        if _includes(self.writes(key), keyexpr):
            return None
        return f"{self.name} may not write {keyexpr}, which is for {_people(key.writers)}"

    def objection_to_delete(self, key: Key[Any, Any], keyexpr: str) -> str | None:
        """Why it may not delete a key expression of that key; `None`: it may. What is over is the
        planner's to delete."""
        if self.roles & Component.PLANNER and any(tree.is_of_one(keyexpr) for tree in KEY_TREES):
            return None
        return self._objection_to_own(key, keyexpr)

    def objection_to_read(self, key: Key[Any, Any], keyexpr: str) -> str | None:
        """Why it may not read a key expression of that key; `None`: it may. Who may write a key may
        read it back."""
        if _includes(self.reads(key), keyexpr) or _includes(self.writes(key), keyexpr):
            return None
        return f"{self.name} may not read {keyexpr}, which is for {_people(key.readers)}"

    def objection_to_names(self, names: Names, robot: str | None) -> str | None:
        """Why who has a certificate may not say that a value, of `robot` if its key names one, is
        from these; `None`: it may. The planner passes on what it was told."""
        if self.roles & Component.PLANNER:
            return None
        person, own = self.author, self.robot or robot
        if person is not None:
            foreign = (names.authors - {person}) | (names.sources - {PERSON_SOURCE})
        else:
            reserved = (PERSON_SOURCE, *_SERVICES)
            foreign = names.authors | {
                each
                for each in names.sources
                if each.partition(":")[0] in reserved or own not in (None, each)
            }
        if not foreign:
            return None
        whose = person or own or "a robot"
        return (
            f"{self.name} has signed it, and it says that it is from {min(foreign)!r}, not {whose}"
        )

    def _pattern(self, key: Key[Any, Any], column: Component, fixed: dict[str, str]) -> str | None:
        if not (granted := self.roles & column):
            return None
        if granted == Component.OWN_WORKER and self.robot is not None:
            fixed = {**fixed, "robot": self.robot}
        return key.pattern(**fixed)

    @property
    def _signature(self) -> str | None:
        """The component by which it signs; `None`: it may be any."""
        if self.name in _SERVICES:
            return self.name
        return None if self.robot is None else f"worker-{self.robot}"


def _includes(allowed: str | None, keyexpr: str) -> bool:
    if allowed is None:
        return False
    allows, chunks = allowed.split("/"), keyexpr.split("/")
    return len(allows) == len(chunks) and all(
        one in ("*", chunk) for one, chunk in zip(allows, chunks, strict=True)
    )


_WORDS = {
    Component.PERSON: "people",
    Component.PLANNER: "the planner",
    Component.WORKER: "robots' workers",
    Component.OWN_WORKER: "that robot's worker",
    Component.SIMULATION: "the simulated world",
    Component.RECORDER: "the recorder",
    Component.STORE: "the store",
}


def _people(column: Component) -> str:
    """A column of the table, in a sentence."""
    if column == Component.ANYONE:
        return "each under its own name"
    words = [words for component, words in _WORDS.items() if component & column]
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))
