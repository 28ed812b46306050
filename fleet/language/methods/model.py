"""Compound tasks and their methods, as in hierarchical planning (SHOP, Nau et al. 1999)."""

from __future__ import annotations

import re
from collections.abc import Mapping

import msgspec

SLOT = re.compile(r"\{\s*(\w+)\s*(?::([^{}]*))?\}")
"""`{n: number}` in a phrase, `{n}` in what it means."""
NUMBER, PLACE, PERSON, ROBOT, OBJECT = "number", "place", "person", "robot", "object"
SKILL_NEED = "skill"


class Method(msgspec.Struct, frozen=True, kw_only=True):
    """One way to do a task: sentences that mean it, where parameters stand as `{n}`.

    `do` are wanted one after the other; the sentences of one row side by side. It can be taken
    where `needs` are there: `2 plate`, `{n} cup & clean | glass` (so many things of a type, one
    where no number is said), `skill wash` (a skill that can be asked for by name).
    """

    do: tuple[tuple[str, ...], ...]
    needs: tuple[str, ...] = ()

    def text(self, given: Mapping[str, str]) -> str:
        """What it means, as sentences."""
        rows = (" ".join(_sentence(filled(text, given)) for text in row) for row in self.do)
        return " Then ".join(rows)


class CompoundTask(msgspec.Struct, frozen=True, kw_only=True):
    """What people call by a name of its own: "set the table for two".

    `says` are the phrases, `methods` the ways to do it, the first that can be taken first.
    `defaults` are for parameters that a phrase leaves out, `file` says where it stands. One that
    `yields` is called only where the grammar makes nothing of the words.
    """

    name: str
    says: tuple[str, ...]
    methods: tuple[Method, ...]
    about: str = ""
    defaults: dict[str, str] = {}
    file: str = ""
    yields: bool = False

    @property
    def shown(self) -> str:
        """Its name, as it is said."""
        return self.name.replace("_", " ")


def filled(text: str, given: Mapping[str, str]) -> str:
    """The text with parameters' values in their places.

    Raises:
        KeyError: one has no value.
    """
    return SLOT.sub(lambda slot: given[slot[1]], text)


def _sentence(text: str) -> str:
    return text if text.endswith((".", "!", "?")) else f"{text}."
