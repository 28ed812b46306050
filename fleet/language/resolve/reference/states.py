"""States and measures that tell things apart, or are wished for and claimed: "clean", "biggest"."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.reference.mentions import Mention, NounPhrase
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.nodes import Quantity
from fleet.language.vocabulary import StateWord, Vocabulary
from keyexpr_schema.facts import FactKey, Literal, Value

_SIZES = {"biggest": 1, "largest": 1, "bigger": 1, "larger": 1, "smallest": -1, "smaller": -1}
_NAMED_SIZES: dict[Value, float] = {
    "tiny": 0,
    "small": 1,
    "medium": 2,
    "large": 3,
    "big": 3,
    "huge": 4,
}
_LOST = frozenset({"missing", "lost"})
_WEIGHTS = {"heaviest": 1, "heavier": 1, "lightest": -1, "lighter": -1}


class Stated:
    """What words for states say of things."""

    def __init__(self, vocabulary: Vocabulary, tagger: Tagger) -> None:
        self.vocabulary, self.states = vocabulary, tagger.verbs.states

    def fits(self, word: StateWord, name: str) -> bool:
        """Whether the word can be said of somebody or something of that name."""
        if word.type in ("place", "robot"):
            return name in (
                self.vocabulary.places if word.type == "place" else self.vocabulary.robots
            )
        thing = self.vocabulary.objects.get(name)
        return thing is not None and word.fits(thing)

    def able(self, lexeme: Lexeme) -> set[str]:
        """Everything that the word can be said of."""
        vocabulary = self.vocabulary
        names = (*vocabulary.objects, *vocabulary.places, *vocabulary.robots)
        return {n for n in names if any(self.fits(w, n) for w in self.states.get(lexeme.words, ()))}

    def wants(
        self, lexeme: Lexeme, name: str, negated: bool = False
    ) -> tuple[tuple[str, Value], ...]:
        """Relations and values that hold of what is so; of what is not, if there are two values.

        Raises:
            NotUnderstood: there is no such state, or no one opposite of it.
        """
        words = [w for w in self.states.get(lexeme.words, ()) if self.fits(w, name)]
        if not words:
            raise NotUnderstood(f"{name} cannot be {lexeme.text}")
        wants = {w.relation: w.value for w in reversed(words)}
        if not negated:
            return tuple(wants.items())
        if len(wants) != 1 or not isinstance(words[0].value, bool):
            raise NotUnderstood(f"'not {lexeme.text}' can be many things: say what shall be so")
        return ((words[0].relation, not words[0].value),)

    def narrowed(
        self, noun: NounPhrase, word: Lexeme, said: Discourse, negated: bool = False
    ) -> NounPhrase:
        """Those of which the word is true, as far as that is believed.

        Raises:
            NotUnderstood: of several it is not known which are so, or none is.
        """
        if word.words not in self.states:
            if word.word in _LOST:
                return self._lost(noun, word.text)
            return self._most(noun, word.word)
        able = noun.among([n for n in noun.names if n in self.able(word)])
        if not able.found:
            raise NotUnderstood(f"{noun.text!r}: nothing of that kind can be {word.text}")
        wants = {name: self.wants(word, name, negated) for name in able.names}
        believed = self.vocabulary.believed
        so = [
            name
            for name in able.names
            if all(believed.get(FactKey(r, name)) == value for r, value in wants[name])
        ]
        if so:
            return noun.among(so)
        made = {(r, v) for phrase in self.vocabulary.skill_phrases for r, v in phrase.wants}
        open_ = noun.quantity is Quantity.ANY or noun.quantity is Quantity.BARE
        if (open_ or len(able.names) == 1) and set(wants[able.names[0]]) <= made:
            mention = Mention(able.names, able.type, noun.key, open=len(able.names) > 1)
            said.extra.append((mention, wants[able.names[0]]))
            return able
        if len(able.names) == 1:
            said.presumed.extend(
                Literal(FactKey(relation, able.names[0]), value)
                for relation, value in wants[able.names[0]]
            )
            return able
        shown = f"not {word.text}" if negated else word.text
        if any(
            all(believed.get(FactKey(r, name)) in (None, value) for r, value in wants[name])
            for name in able.names
        ):
            raise NotUnderstood(
                f"it is not known which of {one_of(able.names)} is {shown}: name it"
            )
        raise NotUnderstood(f"none of {one_of(able.names)} is believed to be {shown}: name it")

    def _lost(self, noun: NounPhrase, word: str) -> NounPhrase:
        """Those of which nobody knows where they are: "the missing shoe"."""
        known = self.vocabulary.place_of
        lost = noun.among([name for name in noun.names if known(name) is None])
        if lost.found or len(noun.names) == 1:
            return lost if lost.found else noun
        raise NotUnderstood(f"it is not known which of {one_of(noun.names)} is {word}: name it")

    def _most(self, noun: NounPhrase, word: str) -> NounPhrase:
        """The one of which a measure is greatest or least."""
        if len(noun.names) == 1:
            return noun
        measured: dict[str, float] = {}
        for name in noun.names:
            thing = self.vocabulary.objects.get(name)
            if thing is None:
                continue
            sizes = [
                float(value)
                for key, value in sorted(thing.properties.items())
                if key.startswith(("size", "volume")) and isinstance(value, int | float)
            ]
            named = [_NAMED_SIZES[v] for v in thing.properties.values() if v in _NAMED_SIZES]
            if word in _WEIGHTS and thing.mass_kg > 0:
                measured[name] = _WEIGHTS[word] * thing.mass_kg
            elif word in _SIZES and sizes:
                measured[name] = _SIZES[word] * sizes[0]
            elif word in _SIZES and named:
                measured[name] = _SIZES[word] * named[0]
        order = sorted(measured, key=lambda n: -measured[n])
        count = noun.count or 1
        edge = sorted(measured.values(), reverse=True)[:count]
        best = [n for n in order if edge and measured[n] >= edge[-1]]
        if len(measured) < len(noun.names) or len(best) != count:
            raise NotUnderstood(
                f"it is not known which of {one_of(noun.names)} is the {word}: name it"
            )
        return noun.among(best)


def of_each(
    stated: Stated, words: Sequence[Lexeme], names: Sequence[str], negated: bool = False
) -> list[tuple[str, str, Value]]:
    """What the words say of each: relation, name, value."""
    return [
        (relation, name, value)
        for name in names
        for word in words
        for relation, value in stated.wants(word, name, negated)
    ]
