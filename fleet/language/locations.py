"""Where things are or shall be: "in the kitchen", "on the table in the hallway"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fleet.errors import NotUnderstood
from fleet.language.cursor import Cursor
from fleet.language.lexicon import Sort
from fleet.language.mentions import Noun, Quantity
from fleet.language.nouns import Nouns
from fleet.language.refusals import one_of
from fleet.language.vocabulary import Vocabulary
from fleet.language.wordlists import BASKETS, DEFINITE, INDEFINITE

PLACES: tuple[Sort, ...] = ("place", "surface")
SPOTS: tuple[Sort, ...] = ("place", "robot", "surface")


@dataclass(frozen=True)
class Part:
    """One prepositional phrase: `to`, `in` or `from`, and what stands behind it."""

    preposition: str
    noun: Noun


@dataclass(frozen=True)
class Where:
    """What the prepositional phrases of one clause say: places or robots, by id.

    `source_surface` and `target_surface` are the surfaces in those places, where one is named.
    `each`: instead of one target, all of several ("to every room"); `said` are their words.
    """

    source: str | None = None
    target: str | None = None
    target_sort: Sort = "place"
    source_surface: str | None = None
    target_surface: str | None = None
    each: tuple[str, ...] = ()
    said: str = ""


class Locations:
    """Reads prepositional phrases of place."""

    def __init__(self, cursor: Cursor, nouns: Nouns, words: Vocabulary) -> None:
        self.cursor, self.nouns, self.words = cursor, nouns, words

    def part(self, preposition: str) -> Part:
        """What stands behind a preposition that was just read.

        Raises:
            NotUnderstood: it is neither a place, nor a robot, nor a robot's basket.
        """
        cursor, start = self.cursor, self.cursor.at
        if (basket := self._basket(start)) is not None:
            return Part(preposition, basket)
        noun = self.nouns.noun("a place", SPOTS)
        if noun.sort == "robot":
            possessed = cursor.take("'s") or cursor.take("'")
            if cursor.take_word(BASKETS):
                noun = noun.among(self._with_baskets()) if noun.generic else noun
                if not noun.found:
                    raise NotUnderstood("no robot with a basket is known")
            elif possessed:
                raise cursor.refusal(
                    f"{cursor.said(start)!r} is followed by what is not understood; "
                    "a robot has a basket"
                )
        return Part(preposition, noun)

    def _with_baskets(self) -> list[str]:
        return sorted(n for n, spec in self.words.robots.items() if "basket" in spec.capabilities)

    def _basket(self, start: int) -> Noun | None:
        """`the basket`, `its basket`, `the basket of the robot`."""
        cursor = self.cursor
        cursor.take_word(DEFINITE | INDEFINITE)
        named = cursor.lexicon.exact(cursor.tokens, cursor.at, SPOTS)[1]
        if named or not cursor.take_word(BASKETS):
            cursor.at = start
            return None
        if cursor.take("of"):
            return self.nouns.noun("a robot", ("robot",))
        owners = self._with_baskets()
        found = tuple(e for e in cursor.lexicon.entities if e.sort == "robot" and e.id in owners)
        if len(found) != 1:
            reason = f"could be that of {one_of(owners)}" if found else "is no robot's"
            raise NotUnderstood(f"{cursor.said(start)!r} {reason}: say whose")
        return Noun(found, cursor.said(start), start, Quantity.THE, exact=True)

    def where(self, parts: Sequence[Part]) -> Where:
        """Source and target of a clause that moves something, or says where something is.

        What stands behind "to" is the target; without it, what stands behind the last "in". Other
        phrases narrow the target ("on the table in the kitchen") or name the source.

        Raises:
            NotUnderstood: a phrase could be several places, or the phrases do not go together.
        """
        targets = [part for part in parts if part.preposition == "to"]
        first_to = next((i for i, part in enumerate(parts) if part.preposition == "to"), len(parts))
        inside = [part for part in parts if part.preposition == "in"]
        sources = [part for part in parts if part.preposition == "from"]
        if targets:
            before = [part for i, part in enumerate(parts) if part in inside and i < first_to]
            sources = [*before, *sources]
            targets = [part for part in parts if part not in sources]
        else:
            targets = inside
            while len(targets) > 1 and not _shared(targets):
                sources = [targets[0], *sources]
                targets = targets[1:]
        source, _ = self._one(sources) if sources else (None, "place")
        if len(targets) == 1 and targets[0].noun.quantity is Quantity.ALL:
            each = targets[0].noun.settle()
            if each.sort == "place" and len(each.subjects) > 1:
                return Where(source, each=each.subjects, said=targets[0].noun.text)
        target, sort = self._one(targets) if targets else (None, "place")
        if source is not None and source == target:
            raise NotUnderstood(f"the sentence says both from and to {source}: say where to")
        kind: Sort = "robot" if sort == "robot" else "place"
        return Where(source, target, kind, _surface(sources, source), _surface(targets, target))

    def _one(self, parts: Sequence[Part]) -> tuple[str, Sort]:
        """The one place or robot that all the phrases mean."""
        shared = _shared(parts)
        if not shared:
            names = " and ".join(repr(part.noun.text) for part in parts)
            raise NotUnderstood(
                f'{names} are two places; if one is to come after the other, say "then"'
            )
        for part in parts:
            mention = part.noun.among(shared).settle()
            if mention.open or len(mention.subjects) != 1:
                raise NotUnderstood(
                    f"{part.noun.text!r} could be {one_of(mention.subjects)}: say which"
                )
        return mention.subjects[0], mention.sort


def _surface(parts: Sequence[Part], place: str | None) -> str | None:
    """The one surface of the place that the phrases name, if they name one."""
    found = {
        entity.id
        for part in parts
        for entity in part.noun.found
        if entity.sort == "surface" and entity.stands_for == place
    }
    return found.pop() if len(found) == 1 else None


def _shared(parts: Sequence[Part]) -> frozenset[str]:
    """Who could be meant by every one of the phrases."""
    found = frozenset(parts[0].noun.names)
    for part in parts[1:]:
        found &= frozenset(part.noun.names)
    return found
