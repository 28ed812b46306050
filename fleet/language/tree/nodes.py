"""The tree of a sentence: clauses, noun phrases, phrases of place. Nothing is resolved yet."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

from fleet.language.tagging.tagger import Lexeme

_Node = TypeVar("_Node")


def _hashed_once(cls: type[_Node]) -> type[_Node]:
    """Have a frozen tree remember its hash: a chart compares each of its values many times."""
    deep = cls.__hash__

    def remembered(self: _Node) -> int:
        known: int | None = self.__dict__.get("_hash")
        if known is None:
            known = deep(self)
            object.__setattr__(self, "_hash", known)
        return known

    cls.__hash__ = remembered  # type: ignore[method-assign, assignment]
    return cls


class Quantity(Enum):
    """What a determiner says."""

    BARE = "cup"
    THE = "the cup"
    ANY = "a cup"
    ALL = "all cups"


@_hashed_once
@dataclass(frozen=True)
class Noun:
    """A noun phrase. `first` and `last` are tokens of the text, `last` excluded.

    `form`: `noun`; `general` (everything, something, everybody); `one` ("the second one");
    `headless` ("the second"); `pronoun`; `me`; `basket`. `other`: "other", "another" or "rest".
    `part`: "one of", so that a plural noun is one thing. `but` are left out. `owner` has a basket.
    """

    form: str
    first: int
    last: int
    quantity: Quantity = Quantity.BARE
    count: int | None = None
    ordinals: tuple[int, ...] = ()
    other: str = ""
    part: bool = False
    adjectives: tuple[Lexeme, ...] = ()
    head: tuple[Lexeme, ...] = ()
    numbers: tuple[int, ...] = ()
    of: tuple[Lexeme, ...] = ()
    use: str | None = None
    owner: Noun | None = None
    relatives: tuple[Relative, ...] = ()
    places: tuple[Place, ...] = ()
    but: Nouns | None = None
    unlike: Nouns | None = None
    """What is not meant, if it could be: "a mug, not the red one"."""
    words: tuple[str, ...] = ()
    """Of a pronoun."""
    whose: Noun | None = None
    """Whose it is: "Anna's mug"."""
    determiner: str = ""
    floor: bool = False
    """Whether it is the floor of a place."""


@_hashed_once
@dataclass(frozen=True)
class Nouns:
    """One noun phrase or several, all of them or (`either`) one of them."""

    items: tuple[Noun, ...]
    either: bool = False


@_hashed_once
@dataclass(frozen=True)
class Relative:
    """`that is on the table`, `which are clean`."""

    places: tuple[Place, ...] = ()
    state: Lexeme | None = None
    negated: bool = False


@_hashed_once
@dataclass(frozen=True)
class Place:
    """A phrase of place, or another phrase with a preposition in front.

    `role` as in `verbs.yaml`; `special`: `house`, `here`, `there`, `anywhere` or `home`.
    """

    role: str
    preposition: str
    nouns: Nouns | None
    first: int
    last: int
    special: str = ""


@dataclass(frozen=True)
class Particle:
    """`up`, `back`, `home`, or an adjective that says how something shall be."""

    lexeme: Lexeme


@dataclass(frozen=True)
class Except:
    """`except the red one`, behind what it is said of."""

    nouns: Nouns


@dataclass(frozen=True)
class Contrast:
    """`not on the sofa`, beside what is meant."""

    what: Nouns | Place


Argument = Nouns | Place | Particle | Except | Contrast


@_hashed_once
@dataclass(frozen=True)
class Predicate:
    """What is said of a subject: states, something done, or places."""

    kind: str
    words: tuple[Lexeme, ...] = ()
    arguments: tuple[Argument, ...] = ()


@_hashed_once
@dataclass(frozen=True)
class Clause:
    """A clause, by the name that the grammar gives its kind."""

    kind: str
    first: int
    last: int
    verb: Lexeme | None = None
    subject: Nouns | None = None
    arguments: tuple[Argument, ...] = ()
    predicate: Predicate | None = None
    words: tuple[Lexeme, ...] = ()
    """All words of the clause that stand in no part of it."""
    front: tuple[Place, ...] = ()
    """Phrases that stand before it, and go for what follows as well: "in the kitchen, …"."""

    def has(self, tag: str) -> bool:
        """Whether one of its own words can be that."""
        return any(tag in word.tags for word in self.words)
