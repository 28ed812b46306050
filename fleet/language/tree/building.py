"""From derivations to trees; what cannot be meant in any world is not built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fleet.language.tagging.lexicon import EntityType
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.determiners import determined
from fleet.language.tree.nodes import (
    Clause,
    Except,
    Noun,
    Nouns,
    Particle,
    Place,
    Predicate,
    Quantity,
    Relative,
)
from fleet.language.words.tokens import number_of

COSTS = {"bare": 2, "whereto": 2, "named": 6, "told": 1, "being": 0, "item": 5, "unknown": 8}
"""How far from plain speech a derivation is: the plainest ones that mean something are meant."""
_THINGS: frozenset[EntityType] = frozenset({"object", "robot"})
_SPOTS: frozenset[EntityType] = frozenset({"place", "surface", "robot"})
_ALL = _THINGS | _SPOTS
_VERBS = ("VERB", "FIN", "GER", "PART")


class Builder:
    """Builds the trees of one sentence; values are (cost, tree), and none means: it cannot be."""

    def __init__(self, words: Sequence[Lexeme], tagger: Tagger) -> None:
        self.words, self.tagger = words, tagger

    def __call__(
        self, name: str, children: tuple[Any, ...], start: int, end: int
    ) -> Sequence[tuple[int, Any]]:
        """The values of a rule."""
        make = getattr(self, f"_{name}", None)
        made = make(children, start, end) if make else self._clause(name, children, start, end)
        if made is None:
            return ()
        return made if isinstance(made, list) else [(COSTS.get(name, 0), made)]

    def _span(self, start: int, end: int) -> tuple[int, int]:
        return self.words[start].first, self.words[end - 1].last

    # --- sentences --------------------------------------------------------------------------------
    def _start(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return tuple(child for child in children if isinstance(child, Clause))

    def _joint(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return "joint"

    _sep = _joint

    def _modal(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return children

    def _clause(self, name: str, children: tuple[Any, ...], start: int, end: int) -> Any:
        verb: Lexeme | None = None
        subject: Nouns | None = None
        more: list[Nouns] = []
        arguments: tuple[Any, ...] = ()
        predicate: Predicate | None = None
        words: list[Lexeme] = []
        for i, child in enumerate(children):
            if isinstance(child, Lexeme):
                followed = i + 1 < len(children) and isinstance(children[i + 1], _Arguments)
                if followed:
                    verb = child
                else:
                    words.append(child)
            elif isinstance(child, Noun):
                child = Nouns((child,))
                subject, more = subject or child, more if subject is None else [*more, child]
            elif isinstance(child, Nouns):
                if subject is None:
                    subject = child
                else:
                    more.append(child)
            elif isinstance(child, _Arguments):
                arguments = (*arguments, *child.items)
            elif isinstance(child, Predicate):
                predicate = child
            elif isinstance(child, Place):
                arguments = (*arguments, child)
            elif isinstance(child, tuple):
                words.extend(child)
        if name in ("do", "told", "never_do") and verb is None:
            return None
        first, last = self._span(start, end)
        return Clause(
            name, first, last, verb, subject, (*more, *arguments), predicate, tuple(words)
        )

    # --- what stands behind verbs -----------------------------------------------------------------
    def _args(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        nouns = [i for i, child in enumerate(children) if isinstance(child, Nouns)]
        if len(nouns) > 2 or (len(nouns) == 2 and nouns[1] != nouns[0] + 1):
            return None
        if len(nouns) == 2 and not self._receives(children[nouns[0]]):
            return None
        return _Arguments(children)

    def _receives(self, nouns: Nouns) -> bool:
        """Whether something can be given to them: "give the robot the cup"."""
        one = nouns.items[0]
        if len(nouns.items) > 1:
            return False
        return one.form in ("me", "pronoun") or any(
            entity.type == "robot" or entity.person for entity in self._entities(one)
        )

    def _arg(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        if len(children) == 2:
            return Except(children[1])
        return Particle(children[0]) if isinstance(children[0], Lexeme) else children[0]

    def _state(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("state", tuple(c for c in children if "ADJ" in c.tags))

    def _done(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("done", (children[0],), children[1].items)

    def _placed(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("placed", (), tuple(
            Particle(c) if isinstance(c, Lexeme) else c
            for c in children
            if isinstance(c, Place) or "HOME" in c.tags or "PARTICLE" in c.tags
        ))  # fmt: skip

    # --- places -----------------------------------------------------------------------------------
    def _prep(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        preposition, nouns = children
        if any(noun.but is not None for noun in nouns.items):
            return None
        if len(nouns.items) > 1 and not all(self._types(noun) & _SPOTS for noun in nouns.items):
            role = self.tagger.book.roles[preposition.words]
            if role in ("to", "in", "from", "via"):
                return None
        role = self.tagger.book.roles[preposition.words]
        first, last = self._span(start, end)
        return Place(role, preposition.word, nouns, first, last)

    def _special(self, children: tuple[Any, ...], start: int, end: int, special: str) -> Any:
        role, word = "to", ""
        if len(children) == 2:
            word = children[0].word
            role = self.tagger.book.roles[children[0].words]
        first, last = self._span(start, end)
        return Place(role, word, None, first, last, special)

    def _house(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "house")

    def _here(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "here")

    def _there_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "there")

    def _anywhere_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "anywhere")

    def _home_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "home")

    # --- noun phrases -----------------------------------------------------------------------------
    def _nps(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        items = tuple(child for child in children if isinstance(child, Noun))
        if items[-1].places:
            return None  # they belong to the clause until the world says otherwise
        if len(items) > 1:
            types = [self._types(item) for item in items]
            if not (all(t & _THINGS for t in types) or all(t & _SPOTS for t in types)):
                return None
        unknown = sum("UNK" in word.tags for item in items for word in item.head)
        bare = len(items) > 1 and items[-1].quantity is Quantity.BARE
        strange = bare and any("UNK" in word.tags for word in items[-1].head)
        cost = COSTS["unknown"] * (bool(unknown) + 2 * strange)  # rather a verb that is not known
        return [(cost, Nouns(items))]

    def _either(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        made = self._nps(children, start, end)
        return made and [(cost, replace(nouns, either=True)) for cost, nouns in made]

    def _item(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        if len(children) == 1:
            return [(0, children[0])]
        if any(place.special for place in children[1:]) or any(
            place.role == "to" for place in children[1:]
        ):
            return None
        return replace(children[0], places=children[1:])

    def _np(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        noun = children[0]
        if len(children) == 2:
            return replace(noun, relatives=(*noun.relatives, children[1]))
        return replace(noun, but=children[2]) if len(children) == 3 else noun

    def _rel(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        places = tuple(child for child in children if isinstance(child, Place))
        if any(place.role == "to" or place.special for place in places):
            return None
        states = [c for c in children[1:] if isinstance(c, Lexeme) and c.tags & {"ADJ", "PART"}]
        states = [] if places else states
        return Relative(places, states[-1] if states else None)

    def _rel_not(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        made = self._rel(children, start, end)
        return made and replace(made, negated=True)

    def _noun(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        pre = tuple(child for child in children if isinstance(child, _Pre))
        rest = [child for child in children if not isinstance(child, _Pre)]
        found = determined(pre)
        if found is None:
            return None
        head: tuple[Lexeme, ...] = rest[0]
        tags = head[-1].tags
        form = "noun"
        if "ONE" in tags:
            form = "one"
            if len(head) == 1 and not pre:
                return None
        elif tags & {"EVERYTHING", "SOMETHING", "EVERYONE"} and "NOUN" not in tags:
            form = "general"
            if pre:
                return None
        noun = replace(found, form=form, head=head)
        for more in rest[1:]:
            if isinstance(more, _Numbers):
                noun = replace(noun, numbers=more.numbers)
            elif isinstance(more, _Of):
                noun = replace(noun, of=more.words)
            else:
                noun = replace(noun, use=more)
        return self._placed_at(noun, start, end)

    def _placed_at(self, noun: Noun, start: int, end: int) -> Noun:
        first, last = self._span(start, end)
        return replace(noun, first=first, last=last)

    def _headless(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        following = self.words[end].tags if end < len(self.words) else frozenset()
        if following & {"NOUN", "UNK", "ONE", "ORD", "BASKET"} or "NUM" in following:
            return None
        words = [word for child in children for word in child.words]
        tags = frozenset().union(*(word.tags for word in words))
        spoken = tuple(word.word for word in words)
        if spoken in (("both",), ("all",), ("each",), ("this",), ("that",), ("these",), ("those",)):
            return self._placed_at(Noun("pronoun", 0, 0, words=spoken), start, end)
        if not tags & {"ORD", "LAST", "NUM", "OTHER", "ANOTHER", "REST", "SUP", "ADJ"}:
            return None
        if len(words) > 1 and "ONE" in words[-1].tags:
            return None
        if words[-1].tags & {"OF", "DET", "INDEF"}:
            return None
        if tags & {"ADJ"} and not tags & {"DET"}:
            return None
        found = determined(children)
        return found and self._placed_at(replace(found, form="headless"), start, end)

    def _pronoun(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        words = tuple(child.word for child in children)
        return self._placed_at(Noun("pronoun", 0, 0, words=words), start, end)

    def _me(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._placed_at(Noun("me", 0, 0), start, end)

    def _basket(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        owner = next((child for child in children if isinstance(child, Noun)), None)
        pre = tuple(child for child in children if isinstance(child, _Pre))
        found = determined(pre)
        if found is None:
            return None
        return self._placed_at(replace(found, form="basket", owner=owner), start, end)

    def _head(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return [(0, children)]

    def _pre(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        child = children[0]
        return [(0, child if isinstance(child, _Pre) else _Pre((child,)))]

    def _ords(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        words = tuple(c for c in children if isinstance(c, Lexeme) and c.tags & {"ORD", "LAST"})
        return _Pre(words)

    def _numbers(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        numbers = [c.number for c in children if isinstance(c, Lexeme) and "NUM" in c.tags]
        following = self.words[end].tags if end < len(self.words) else frozenset()
        if len(numbers) > 1 and following & {"NOUN", "OF", "UNK"}:
            return None
        return _Numbers(tuple(n for n in numbers if n is not None))

    def _of(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return _Of(tuple(c for c in children[1:] if isinstance(c, Lexeme)))

    def _use(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return children[1].word

    # --- types ------------------------------------------------------------------------------------
    def _entities(self, noun: Noun) -> Sequence[Any]:
        return self.tagger.entities(noun.head[0].words) if noun.head else ()

    def _types(self, noun: Noun) -> frozenset[EntityType]:
        """What the noun can be, as far as its words say it."""
        if noun.form == "basket":
            return frozenset({"robot", "surface", "object"})
        if noun.form == "general":
            return frozenset({"robot"} if "EVERYONE" in noun.head[0].tags else {"object"})
        if noun.form != "noun" or any("UNK" in word.tags for word in noun.head):
            return _ALL if noun.form != "me" else frozenset({"object", "surface"})
        return frozenset(entity.type for entity in self._entities(noun))


class _Arguments(tuple[Any, ...]):
    __slots__ = ()

    @property
    def items(self) -> tuple[Any, ...]:
        """The arguments, in their order."""
        return tuple(self)


class _Pre(tuple[Any, ...]):
    __slots__ = ()

    @property
    def words(self) -> tuple[Lexeme, ...]:
        """Words before a noun."""
        return tuple(self)


class _Numbers(tuple[Any, ...]):
    __slots__ = ()

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers behind a noun."""
        return tuple(self)


class _Of(tuple[Any, ...]):
    __slots__ = ()

    @property
    def words(self) -> tuple[Lexeme, ...]:
        """The nouns behind "of"."""
        return tuple(self)


__all__ = ["Builder", "number_of"]
