"""From derivations to trees; what cannot be meant in any world is not built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.nodes import (
    Clause,
    Contrast,
    Except,
    Noun,
    Nouns,
    Particle,
    Place,
    Predicate,
    Quantity,
)
from fleet.language.tree.noun_building import BUT_NOT, COSTS, SPOTS, NounBuilder

_FRONTED = frozenset({
    "do", "told", "shall_be", "kept", "never_be", "never_do", "needs_doing", "whether", "asked",
})  # fmt: skip
"""Kinds of clauses that a phrase of place may stand before."""


class Builder:
    """Builds the trees of one sentence; values are (cost, tree), and none means: it cannot be."""

    def __init__(self, words: Sequence[Lexeme], tagger: Tagger) -> None:
        self.words, self.tagger = words, tagger
        self.nouns = NounBuilder(words, tagger)

    def __call__(
        self, name: str, children: tuple[Any, ...], start: int, end: int
    ) -> Sequence[tuple[int, Any]]:
        """The values of a rule."""
        handler = f"make_{name}"
        make = getattr(self, handler, None) or getattr(self.nouns, handler, None)
        made = make(children, start, end) if make else self._clause(name, children, start, end)
        if made is None:
            return ()
        return made if isinstance(made, list) else [(COSTS.get(name, 0), made)]

    def make_joint(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        """What joins clauses."""
        return "joint"

    def make_start(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return tuple(child for child in children if isinstance(child, Clause))

    def make_fronted(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        """`in the kitchen, close all cupboards`."""
        front = tuple(child for child in children if isinstance(child, Place))
        first, *others = (child for child in children if isinstance(child, Clause))
        if first.kind not in _FRONTED or any(place.special == "house" for place in front):
            return None
        apart = not any(isinstance(c, Lexeme) and "COMMA" in c.tags for c in children)
        return [(1 + apart, (replace(first, front=front), *others))]

    def make_modal(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return children

    def make_args(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        children = self._receiver_somewhere(children)
        nouns = [i for i, child in enumerate(children) if isinstance(child, Nouns)]
        if len(nouns) > 2 or (len(nouns) == 2 and nouns[1] != nouns[0] + 1):
            return None
        if len(nouns) == 2 and not self._receives(children[nouns[0]]):
            return None
        return _Arguments(children)

    def _receiver_somewhere(self, children: tuple[Any, ...]) -> tuple[Any, ...]:
        """With "the patient in room 102" as one, where what they are to have follows."""
        if len(children) < 3 or not isinstance(children[0], Nouns):
            return children
        first, place, nouns = children[:3]
        if not isinstance(place, Place) or not isinstance(nouns, Nouns) or place.special:
            return children
        if place.role != "in" or not self._receives(first) or first.items[0].form != "noun":
            return children
        where = replace(first.items[0], places=(place,))
        return (replace(first, items=(where,)), *children[2:])

    def _receives(self, nouns: Nouns) -> bool:
        """Whether something can be given to them: "give the robot the cup"."""
        one = nouns.items[0]
        if len(nouns.items) > 1:
            each = (self.nouns.entities(item) for item in nouns.items)
            return not nouns.either and all(any(e.person for e in found) for found in each)
        return one.form in ("me", "pronoun") or any(
            entity.type == "robot" or entity.person for entity in self.nouns.entities(one)
        )

    def make_arg(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        if isinstance(children[0], Lexeme) and "COMMA" in children[0].tags:
            children = children[1:]
        if isinstance(children[0], Lexeme) and "NOT" in children[0].tags:
            return Contrast(children[1])
        if isinstance(children[0], Lexeme) and "EXCEPT" in children[0].tags and len(children) > 1:
            left_out = self.nouns.left_out(children[1], children[2:])
            if left_out and children[0].words == BUT_NOT:
                return Contrast(left_out)
            return left_out and [(self.nouns.apart(children[2:]), Except(left_out))]
        return Particle(children[0]) if isinstance(children[0], Lexeme) else children[0]

    def make_state(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("state", tuple(c for c in children if "ADJ" in c.tags))

    def make_done(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("done", (children[0],), children[1].items)

    def make_placed(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return Predicate("placed", (), tuple(
            Particle(c) if isinstance(c, Lexeme) else c
            for c in children
            if isinstance(c, Place) or "HOME" in c.tags or "PARTICLE" in c.tags
        ))  # fmt: skip

    def make_prep(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        preposition, nouns = children
        if any(noun.but is not None for noun in nouns.items):
            return None
        listed = len(nouns.items) > 1
        if listed and any("TOO" in word.tags for word in self.words[start:end]):
            return None  # "on the table, and the plate as well"
        if listed and not all(self.nouns.types(noun) & SPOTS for noun in nouns.items):
            role = self.tagger.book.roles[preposition.words]
            if role in ("to", "in", "from", "via"):
                return None
        role = self.tagger.book.roles[preposition.words]
        first, last = self.nouns.span(start, end)
        things = listed and any("place" not in self.nouns.types(noun) for noun in nouns.items)
        return [(COSTS["things"] * things, Place(role, preposition.word, nouns, first, last))]

    def make_preps(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        """`in the kitchen and in the hall`: as "in the kitchen and the hall"."""
        words = [c for c in children if isinstance(c, Lexeme)]
        named = [c for c in children if isinstance(c, Nouns)]
        roles = {self.tagger.book.roles[word.words] for word in words}
        items = tuple(noun for nouns in named for noun in nouns.items)
        marked = any("TOO" in word.tags for word in self.words[start:end])
        spots = all(self.nouns.types(noun) & SPOTS for noun in items)
        if marked or not spots or len(roles) > 1 or not roles & {"in", "from"}:
            return None
        if any(nouns.either for nouns in named) or any(noun.but for noun in items):
            return None
        first, last = self.nouns.span(start, end)
        return [(1, Place(roles.pop(), words[0].word, Nouns(items), first, last))]

    def _special(self, children: tuple[Any, ...], start: int, end: int, special: str) -> Any:
        role, word = "to", ""
        if len(children) == 2:
            word = children[0].word
            role = self.tagger.book.roles[children[0].words]
        first, last = self.nouns.span(start, end)
        return Place(role, word, None, first, last, special)

    def make_house(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "house")

    def make_here(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "here")

    def make_there_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "there")

    def make_anywhere_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "anywhere")

    def make_where_is(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        first, last = self.nouns.span(start, end)
        nouns = next(child for child in children if isinstance(child, Nouns))
        return Place("to", "where", nouns, first, last, "where")

    def make_home_place(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._special(children, start, end, "home")

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
        if name == "told_after":
            *arguments_, who = (*arguments, *more) if subject is None else (*arguments, subject)
            if not all(self.nouns.types(noun) <= {"robot"} for noun in who.items):
                return None
            name, subject, arguments, more = "told", who, tuple(arguments_), []
        if name == "where_in":
            subject, more = (more[0] if more else subject), []
            name, arguments = "where", ()
        if name == "none_there" and predicate is not None and subject is not None:
            each = (replace(noun, quantity=Quantity.ALL) for noun in subject.items)
            name, subject = "never_be", replace(subject, items=tuple(each), either=False)
        too = (self.words[start].tags | self.words[end - 1].tags) & {"TOO"}
        if name == "another":  # "and the one in the hallway too"
            there = tuple(a for a in arguments if isinstance(a, Place) and a.role in ("in", "from"))
            if not too or subject is None or there != arguments:
                return None
            one = replace(subject.items[-1], places=there)
            subject, arguments = replace(subject, items=(*subject.items[:-1], one)), ()
        if name == "another" or (name == "named" and too):
            name = "likewise"
        first, last = self.nouns.span(start, end)
        return Clause(
            name, first, last, verb, subject, (*more, *arguments), predicate, tuple(words)
        )


class _Arguments(tuple[Any, ...]):
    __slots__ = ()

    @property
    def items(self) -> tuple[Any, ...]:
        """The arguments, in their order."""
        return tuple(self)
