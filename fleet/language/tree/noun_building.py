"""Noun phrases from derivations; what cannot be meant in any world is not built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

from fleet.language.tagging.lexicon import EntityType
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.determiners import determined
from fleet.language.tree.nodes import (
    Noun,
    Nouns,
    Place,
    Quantity,
    Relative,
)

COSTS = {
    "bare": 2,
    "whereto": 2,
    "named": 6,
    "another": 2,
    "owned_one": 3,
    "told": 1,
    "being": 0,
    "remarked": 1,
    "item": 5,
    "unknown": 8,
    "paired": 3,
    "things": 3,
}
"""How far from plain speech a derivation is: the plainest ones that mean something are meant."""
_THINGS: frozenset[EntityType] = frozenset({"object", "robot"})
SPOTS: frozenset[EntityType] = frozenset({"place", "surface", "robot"})
_ALL = _THINGS | SPOTS
BUT_NOT = ("but", "not")
"""What follows may be something else altogether: "the radio, but not the TV"."""
_USED_ITSELF = frozenset({"eat", "drink", "read", "wear"})
"""What is good for these is what they are done to, and no means for it."""
_ROOM = 50
"""Numbers of things that "1 to 3" may name."""


class NounBuilder:
    """Builds the noun phrases of one sentence."""

    def __init__(self, words: Sequence[Lexeme], tagger: Tagger) -> None:
        self.words, self.tagger = words, tagger
        self._types: dict[tuple[int, int, str], frozenset[EntityType]] = {}

    def make_sep(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        """What joins the items of a list."""
        return "joint"

    def make_nps(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        items = tuple(child for child in children if isinstance(child, Noun))
        if items[-1].places:
            return None  # they belong to the clause until the world says otherwise
        if len(items) > 1:
            types = [self.types(item) for item in items]
            if not (all(t & _THINGS for t in types) or all(t & SPOTS for t in types)):
                return None
        last = items[-1]
        plain = last.form == "noun" and not last.numbers and last.quantity is Quantity.BARE
        if len(items) > 1 and plain and last.head[0].word in self.tagger.book.describing:
            return None  # "a coffee, black"
        unknown = sum(
            "UNK" in word.tags or (len(item.head) == 2 and "ONE" not in item.head[-1].tags)
            for item in items
            for word in item.head
        )
        bare = len(items) > 1 and items[-1].quantity is Quantity.BARE
        strange = bare and any("UNK" in word.tags for word in items[-1].head)
        cost = COSTS["unknown"] * (bool(unknown) + 2 * strange)  # rather a verb that is not known
        numbered = [item.numbers and not later.head for item, later in pairwise(items)]
        cost += COSTS["item"] * any(numbered)  # "pallets 2 and 3" are no pallet and three others
        cost += sum(item.but is not None for item in items[:-1])  # rather more is left out
        return [(cost, Nouns(items))]

    def make_subject(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        if isinstance(children[0], Nouns):
            return [(0, children[0])]
        item = self.make_item(children, start, end)
        return item and [(1, Nouns((item,)))]

    def make_either(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        made = self.make_nps(children, start, end)
        return made and [(cost, replace(nouns, either=True)) for cost, nouns in made]

    def make_item(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        if len(children) == 1:
            return [(0, children[0])]
        everywhere = [place for place in children[1:] if place.special == "house"]
        if everywhere and children[0].quantity is Quantity.ALL:  # "all the lights in the house"
            children = tuple(c for c in children if c not in everywhere)
        if any(place.special or place.role == "to" for place in children[1:]):
            return None
        return replace(children[0], places=children[1:])

    def make_np(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        noun = children[0]
        children = tuple(c for c in children if not (isinstance(c, Lexeme) and "COMMA" in c.tags))
        if len(children) == 2:
            return replace(noun, relatives=(*noun.relatives, children[1]))
        if len(children) < 3:
            return noun
        left_out = self.left_out(children[2], children[3:])
        if left_out and children[1].words == BUT_NOT:
            return [(self.apart(children[3:]), replace(noun, unlike=left_out))]
        return left_out and [(self.apart(children[3:]), replace(noun, but=left_out))]

    @staticmethod
    def apart(places: Sequence[Place]) -> int:
        """How odd it is that what is left out is there: "from" says where all of them are."""
        return 2 if any(place.role == "from" for place in places) else not places

    @staticmethod
    def left_out(nouns: Nouns, places: tuple[Any, ...]) -> Nouns | None:
        """What is left out, with where it is."""
        if any(place.role == "to" or place.special for place in places):
            return None
        last = replace(nouns.items[-1], places=places)
        return replace(nouns, items=(*nouns.items[:-1], last))

    def make_rel(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        places = tuple(child for child in children if isinstance(child, Place))
        if any(place.role == "to" or place.special for place in places):
            return None
        states = [c for c in children[1:] if isinstance(c, Lexeme) and c.tags & {"ADJ", "PART"}]
        states = [] if places else states
        return Relative(places, states[-1] if states else None)

    def make_rel_not(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        made = self.make_rel(children, start, end)
        return made and replace(made, negated=True)

    def make_noun(self, children: tuple[Any, ...], start: int, end: int) -> Any:
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
                if pre and self.words[end - 1].spoken == "one":
                    return None  # "a red one" is no red thing of that number
                if more.through and not head[-1].word.endswith("s"):
                    return None  # "pallet 1 to 2" says where to
                noun = replace(noun, numbers=more.numbers)
            elif isinstance(more, _Of):
                noun = replace(noun, of=more.words)
            else:
                noun = replace(noun, use=more)
        return self._placed_at(noun, start, end)

    def make_owned(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        made = self.make_noun(children[2:], start, end)
        if made is None:
            return None
        owner = children[0]
        if owner.quantity is Quantity.ALL or owner.part:  # "both of Ben's shirts"
            made = replace(made, quantity=owner.quantity, count=owner.count, part=owner.part)
            owner = replace(owner, quantity=Quantity.BARE, count=None, part=False, determiner="")
            return replace(made, whose=owner)
        quantity = Quantity.THE if made.quantity is Quantity.BARE else made.quantity
        return replace(made, whose=children[0], quantity=quantity)

    def make_owned_one(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        """`Carla's`, of the kind that was spoken of."""
        one = Noun("headless", 0, 0, Quantity.THE, whose=children[0])
        return [(COSTS["owned_one"], self._placed_at(one, start, end))]

    def make_floor(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        words = [child for child in children if isinstance(child, Lexeme)]
        if any("PREP" in w.tags and w.words not in (("in",), ("of",)) for w in words):
            return None
        found = determined(tuple(child for child in children if isinstance(child, _Pre)))
        nouns = [w for w in words if "NOUN" in w.tags and "FLOOR" not in w.tags]
        if found is None or not nouns:
            return None
        return self._placed_at(replace(found, head=(nouns[-1],), floor=True), start, end)

    def make_whatever(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        places = tuple(child for child in children if isinstance(child, Place))
        if any(place.role == "to" or place.special for place in places):
            return None
        nouns = [c for c in children[1:] if isinstance(c, Lexeme) and "BE" not in c.tags]
        state = None if places else nouns.pop()
        first, last = self.span(start, end)
        return Noun(
            "noun" if nouns else "whatever",
            first,
            last,
            Quantity.ALL,
            head=tuple(nouns[:1]),
            relatives=(Relative(places, state),),
        )

    def make_general_so(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        states = tuple(c for c in children[1:] if isinstance(c, Lexeme))
        use = next((c for c in children if isinstance(c, str) and not isinstance(c, Lexeme)), None)
        noun = Noun("general", 0, 0, head=(children[0],), adjectives=states, use=use)
        return self._placed_at(noun, start, end)

    def make_both_of(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self.make_nps(children[1:], start, end) if children[0].word == "both" else None

    def _placed_at(self, noun: Noun, start: int, end: int) -> Noun:
        first, last = self.span(start, end)
        return replace(noun, first=first, last=last)

    def make_headless(self, children: tuple[Any, ...], start: int, end: int) -> Any:
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

    def make_pronoun(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        words = tuple(child.word for child in children)
        return self._placed_at(Noun("pronoun", 0, 0, words=words), start, end)

    def make_me(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return self._placed_at(Noun("me", 0, 0), start, end)

    def make_basket(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        owner = next((child for child in children if isinstance(child, Noun)), None)
        pre = tuple(child for child in children if isinstance(child, _Pre))
        found = determined(pre)
        if found is None:
            return None
        return self._placed_at(replace(found, form="basket", owner=owner), start, end)

    def make_head(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return [(0, children)]

    def make_pre(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        child = children[0]
        return [(0, child if isinstance(child, _Pre) else _Pre((child,)))]

    def make_ords(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        words = tuple(c for c in children if isinstance(c, Lexeme) and c.tags & {"ORD", "LAST"})
        return _Pre(words)

    def make_numbers(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        numbers = [c.number for c in children if isinstance(c, Lexeme) and "NUM" in c.tags]
        following = self.words[end].tags if end < len(self.words) else frozenset()
        if len(numbers) > 1 and following & {"NOUN", "OF", "UNK"}:
            return None
        return _Numbers(tuple(n for n in numbers if n is not None))

    def make_numbers_through(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        first, last = (c.number for c in children if "NUM" in c.tags)
        if not 0 <= last - first < _ROOM:
            return None
        return _Numbers(tuple(range(first, last + 1)), through=True)

    def make_of(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        return _Of(tuple(c for c in children[1:] if isinstance(c, Lexeme)))

    def make_use(self, children: tuple[Any, ...], start: int, end: int) -> Any:
        verb, behind = children[1].word, [child.word for child in children[2:]]
        if behind and (verb in _USED_ITSELF or (verb == "write" and behind != ["with"])):
            return None  # what is there to eat is nothing to eat with
        return verb

    # --- types ----------------------------------------------------------------------------
    def entities(self, noun: Noun) -> Sequence[Any]:
        return self.tagger.entities(noun.head[0].words) if noun.head else ()

    def types(self, noun: Noun) -> frozenset[EntityType]:
        """What the noun can be, as far as its words say it."""
        key = (noun.first, noun.last, noun.form)
        if (known := self._types.get(key)) is None:
            known = self._types[key] = self._types_of(noun)
        return known

    def _types_of(self, noun: Noun) -> frozenset[EntityType]:
        if noun.form == "basket":
            return frozenset({"robot", "surface", "object"})
        if noun.form == "whatever":
            return frozenset({"object"})
        if noun.floor:
            return frozenset(e.type for e in self.entities(noun) if e.type == "place")
        if noun.form == "general":
            return frozenset({"robot"} if "EVERYONE" in noun.head[0].tags else {"object"})
        if noun.form != "noun" or any("UNK" in word.tags for word in noun.head):
            return _ALL if noun.form != "me" else frozenset({"object", "surface"})
        return frozenset(entity.type for entity in self.entities(noun))

    def span(self, start: int, end: int) -> tuple[int, int]:
        return self.words[start].first, self.words[end - 1].last


class _Pre(tuple[Any, ...]):
    __slots__ = ()

    @property
    def words(self) -> tuple[Lexeme, ...]:
        """Words before a noun."""
        return tuple(self)


class _Numbers(NamedTuple):
    """Numbers behind a noun; `through`: the first and the last were said."""

    numbers: tuple[int, ...]
    through: bool = False


class _Of(tuple[Any, ...]):
    __slots__ = ()

    @property
    def words(self) -> tuple[Lexeme, ...]:
        """The nouns behind "of"."""
        return tuple(self)
