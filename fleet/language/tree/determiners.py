"""What the words before a noun say: how many, which in order, of what kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.language.tagging.tagger import Lexeme
from fleet.language.tree.nodes import Noun, Quantity
from fleet.language.words.tokens import ordinal_of


class _Walk:
    def __init__(self, words: Sequence[Sequence[Lexeme]]) -> None:
        self.groups, self.at = words, 0

    def take(self, *tags: str) -> Lexeme | None:
        """Go past the next word if it can be one of these."""
        if self.at < len(self.groups) and len(self.groups[self.at]) == 1:
            word = self.groups[self.at][0]
            if any(tag in word.tags for tag in tags):
                self.at += 1
                return word
        return None

    def take_plain(self, tag: str) -> Lexeme | None:
        """The same, of a word that is no state as well: "a whole apple", where some are cut."""
        group = self.groups[self.at] if self.at < len(self.groups) else ()
        return None if any("ADJ" in word.tags for word in group) else self.take(tag)


def determined(groups: Sequence[Sequence[Lexeme]]) -> Noun | None:
    """A noun phrase without its noun, from its words (several of one: "first and second").

    `None`: they do not stand in an order that means something.
    """
    walk = _Walk(groups)
    noun = Noun("noun", 0, 0)
    if word := walk.take("UNIV"):
        noun = replace(noun, quantity=Quantity.ALL, count=2 if word.word == "both" else None)
        walk.take("SINGLE")
        walk.take("OF")
        if word := walk.take("DET"):
            noun = replace(noun, determiner=word.word)
    elif word := walk.take("INDEF"):
        noun = replace(noun, quantity=Quantity.ANY, determiner=word.word)
        walk.take_plain("SINGLE")
        if walk.take("OF"):
            walk.take("DET")
            noun = replace(noun, part=word.word != "some")
    elif word := walk.take("DET"):
        noun = replace(noun, quantity=Quantity.THE, determiner=word.word)
        walk.take_plain("SINGLE")
    elif walk.take("ANOTHER"):
        noun = replace(noun, quantity=Quantity.ANY, other="another")
    if walk.take("REST"):
        noun = replace(noun, quantity=Quantity.ALL, other="rest")
        walk.take("OF")
        walk.take("DET")
    noun = _counted(noun, walk)
    if walk.take("OTHER"):
        noun = replace(noun, other=noun.other or "other")
        noun = _counted(noun, walk) if noun.count is None else noun
    ordinals = _ordinals(walk)
    if ordinals:
        if noun.count is not None or noun.other:
            return None
        noun = _counted(replace(noun, ordinals=ordinals), walk)
    adjectives = []
    while word := walk.take("ADJ", "SUP"):
        adjectives.append(word)
    if adjectives and "SUP" in adjectives[-1].tags and walk.take("OF"):  # "the larger of the two"
        walk.take("DET")
        walk.take("NUM")
        noun = replace(noun, part=True)
    noun = replace(noun, adjectives=tuple(adjectives))
    return noun if walk.at == len(walk.groups) else None


def _counted(noun: Noun, walk: _Walk) -> Noun:
    word = walk.take("NUM")
    if word is None or word.number is None:
        return noun
    number = word.number
    count: int | None = number if noun.count in (None, number) else -1
    quantity, part = noun.quantity, noun.part
    if number == 1 and quantity in (Quantity.BARE, Quantity.ANY) and not noun.ordinals:
        quantity, count, part = Quantity.ANY, None, True
    if walk.take("OF"):
        walk.take("DET")
        part = True
    return replace(noun, quantity=quantity, count=count, part=part)


def _ordinals(walk: _Walk) -> tuple[int, ...]:
    if walk.at >= len(walk.groups):
        return ()
    group = walk.groups[walk.at]
    found = tuple(
        0 if "LAST" in word.tags else ordinal_of(word.words[0]) or 1
        for word in group
        if word.tags & {"ORD", "LAST"}
    )
    walk.at += bool(found)
    return found
