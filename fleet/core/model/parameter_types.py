"""Types of parameters: `robot`, `place`, `object`, or which things by kind, category or feature.

`cup | glass` is one or the other, `movable & washable` both at once; `&` binds closer. A word that
is no base type is said of things: of their kind, one of their categories, or a feature.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property, lru_cache

from keyexpr_schema.payloads.world import Object

ROBOT, PLACE, OBJECT = "robot", "place", "object"
BASE_TYPES = (ROBOT, PLACE, OBJECT)
_WORD = re.compile(r"[A-Za-z_][\w-]*")


class BadType(ValueError):
    """A text that is no type; the message says in which way."""


@dataclass(frozen=True)
class ParameterType:
    """What a parameter, or a variable of a quantifier, may stand for: one of `alternatives`, each
    of them words that hold all at once."""

    alternatives: tuple[tuple[str, ...], ...]

    def __str__(self) -> str:
        return " | ".join(" & ".join(words) for words in self.alternatives)

    @cached_property
    def bases(self) -> tuple[str, ...]:
        """Which of `robot`, `place` and `object` its names can be."""
        found = {
            word if word in BASE_TYPES else OBJECT for row in self.alternatives for word in row
        }
        return tuple(base for base in BASE_TYPES if base in found)

    def admits(self, kind: str | None, thing: Object | None) -> bool:
        """Whether a name of that base type may stand here; `thing` is the object."""
        return any(
            all(word == kind or (thing is not None and thing.is_a(word)) for word in words)
            for words in self.alternatives
        )


@lru_cache(maxsize=4096)
def parse_type(text: str) -> ParameterType:
    """The type that `text` says.

    Raises:
        BadType: it is none.
    """
    alternatives = []
    for part in text.split("|"):
        words = tuple(word.strip() for word in part.split("&"))
        for word in words:
            if not _WORD.fullmatch(word):
                raise BadType(
                    f"{text!r} must be robot, place, object, or features, kinds and categories of "
                    "things, joined by & and |"
                )
        if len(words) > 1 and not {ROBOT, PLACE}.isdisjoint(words):
            raise BadType(
                f"{text!r} narrows {ROBOT} or {PLACE}, which stand alone; & is for things"
            )
        alternatives.append(words)
    if any(words == (ROBOT,) for words in alternatives) and len(alternatives) > 1:
        raise BadType(
            f"{text!r} would be a robot or something else; a robot takes part or does not"
        )
    return ParameterType(tuple(alternatives))


def narrowed(one: ParameterType, other: ParameterType) -> ParameterType | None:
    """Names that are of both types; `None` if there cannot be any."""
    rows = []
    for words in one.alternatives:
        for more in other.alternatives:
            both = dict.fromkeys((*words, *more))
            if len(both) > 1 and not {ROBOT, PLACE}.isdisjoint(both):
                continue
            rows.append(tuple(word for word in both if word != OBJECT) or (OBJECT,))
    return ParameterType(tuple(dict.fromkeys(rows))) if rows else None


def names_of(
    type_: ParameterType,
    robots: Collection[str],
    places: Collection[str],
    things: Collection[Object],
) -> tuple[str, ...]:
    """Everything that exists and is of the type, in a fixed order."""
    found: list[str] = []
    if ROBOT in type_.bases:
        found += robots
    if PLACE in type_.bases:
        found += places
    found += [thing.object for thing in things if type_.admits(OBJECT, thing)]
    return tuple(found)


def with_article(kind: str) -> str:
    """The name of a type as a sentence has it: an object, a place."""
    return f"an {kind}" if kind[:1] in "aeio" else f"a {kind}"
