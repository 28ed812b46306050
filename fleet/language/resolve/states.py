"""States and measures that tell things apart, or are wished for and claimed: "clean", "biggest"."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.mentions import NounPhrase
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.vocabulary import SkillPhrase, Vocabulary
from keyexpr_schema.facts import FactKey, Literal, Value

_BIG = frozenset({"biggest", "largest"})
_SMALL = frozenset({"smallest"})
_HEAVY = {"heaviest": 1, "lightest": -1}


class Stated:
    """What words for states say of things."""

    def __init__(self, vocabulary: Vocabulary, tagger: Tagger) -> None:
        self.vocabulary, self.states = vocabulary, tagger.verbs.states

    def skill(self, lexeme: Lexeme, names: Sequence[str] = ()) -> SkillPhrase:
        """The skill that makes things so: of several, the first that can be done to all of them.

        Raises:
            NotUnderstood: there is none.
        """
        phrases = self.states.get(lexeme.words, [])
        things = [self.vocabulary.objects[n] for n in names if n in self.vocabulary.objects]
        fitting = [p for p in phrases if things and all(map(p.fits, things))]
        if not phrases:
            raise NotUnderstood(f"{lexeme.text!r} is no state that a known skill brings about")
        return (fitting or phrases)[0]

    def wants(
        self, lexeme: Lexeme, names: Sequence[str] = (), negated: bool = False
    ) -> tuple[tuple[str, Value], ...]:
        """Relations and values that hold of what is so; of what is not, if there are two values.

        Raises:
            NotUnderstood: there is no such state, or no one opposite of it.
        """
        wants = self.skill(lexeme, names).wants
        if not negated:
            return wants
        if len(wants) != 1 or not isinstance(wants[0][1], bool):
            raise NotUnderstood(f"'not {lexeme.text}' can be many things: say what shall be so")
        return ((wants[0][0], not wants[0][1]),)

    def narrowed(
        self, noun: NounPhrase, word: Lexeme, said: Discourse, negated: bool = False
    ) -> NounPhrase:
        """Those of which the word is true, as far as that is believed.

        Raises:
            NotUnderstood: of several it is not known which are so, or none is.
        """
        if "SUP" in word.tags and word.words not in self.states:
            return self._most(noun, word.word)
        able = noun.among([n for n in noun.names if self._can_be(n, word)])
        if not able.found:
            raise NotUnderstood(f"{noun.text!r}: nothing of that kind can be {word.text}")
        wants = self.wants(word, able.names, negated)
        believed = self.vocabulary.believed
        so = [
            name
            for name in able.names
            if all(believed.get(FactKey(relation, name)) == value for relation, value in wants)
        ]
        if so:
            return noun.among(so)
        unsure = [
            name
            for name in able.names
            if all(
                believed.get(FactKey(relation, name)) in (None, value) for relation, value in wants
            )
        ]
        if len(able.names) == 1:
            said.presumed.extend(
                Literal(FactKey(relation, able.names[0]), value) for relation, value in wants
            )
            return able
        if unsure:
            raise NotUnderstood(
                f"it is not known which of {one_of(able.names)} is {word.text}: name it"
            )
        raise NotUnderstood(f"none of {one_of(able.names)} is believed to be {word.text}: name it")

    def _can_be(self, name: str, word: Lexeme) -> bool:
        thing = self.vocabulary.objects.get(name)
        return thing is not None and any(p.fits(thing) for p in self.states.get(word.words, ()))

    def _most(self, noun: NounPhrase, word: str) -> NounPhrase:
        """The one of which a measure is greatest or least."""
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
            if word in _HEAVY and thing.mass_kg > 0:
                measured[name] = _HEAVY[word] * thing.mass_kg
            elif word in _BIG | _SMALL and sizes:
                measured[name] = sizes[0] if word in _BIG else -sizes[0]
        best = [n for n in measured if measured[n] == max(measured.values())]
        if len(measured) < len(noun.names) or len(best) != 1:
            raise NotUnderstood(
                f"it is not known which of {one_of(noun.names)} is the {word}: name it"
            )
        return noun.among(best)
