"""From words to tagged words: what each, or each phrase, can be."""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence
from dataclasses import dataclass
from typing import Any

from fleet.language.tagging.lexicon import ENTITY_TYPES, Entity, Lexicon
from fleet.language.tagging.skill_words import SkillWords
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.latest import Latest
from fleet.language.words.times import TimePhrase, time_at
from fleet.language.words.tokens import Phrase, Token, number_of, ordinal_of

_VERBAL = frozenset({"VERB", "FIN", "PART", "GER", "ADJ"})


@dataclass(frozen=True, eq=False)
class Lexeme:
    """A word, or words that stand together as one, with all that it can be.

    `first` and `last` count the tokens of the text, `last` excluded; `text` is as it was written.
    """

    words: Phrase
    tags: frozenset[str]
    first: int
    last: int
    text: str
    spoken: str = ""
    time: TimePhrase | None = None

    @property
    def word(self) -> str:
        """The words with spaces."""
        return " ".join(self.words)

    @property
    def number(self) -> int | None:
        """The number that it is."""
        return number_of(self.words[0]) if "NUM" in self.tags else None


class Tagger:
    """Tags the words of texts, in one world."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.book = vocabulary.wordbook
        self.lexicon = Lexicon(vocabulary)
        self.verbs = SkillWords(vocabulary)
        self.phrases: dict[Phrase, frozenset[str]] = dict(self.book.phrases)
        more: dict[Phrase, set[str]] = {}
        for form, senses in self.verbs.forms.items():
            more.setdefault(form, set()).update(tag for tag, _ in senses)
        for literal in self.verbs.literals:
            more.setdefault(literal, set()).add("PARTICLE")
        for state in self.verbs.states:
            more.setdefault(state, set()).add("ADJ")
        for entity in self.lexicon.entities:
            for use in entity.uses:
                more.setdefault((use,), set()).add("USE")
        for form, tags in more.items():
            self.phrases[form] = self.phrases.get(form, frozenset()) | tags
        self._longest: dict[str, int] = {}
        for phrase in self.phrases:
            self._longest[phrase[0]] = max(len(phrase), self._longest.get(phrase[0], 0))

    def entities(self, words: Phrase) -> tuple[Entity, ...]:
        """Everybody whom these words can mean."""
        return self.lexicon.meant(words)

    def tagged(self, tokens: Sequence[Token], text: str) -> list[Lexeme]:
        """The words of one text, left to right."""
        found: list[Lexeme] = []
        at = 0
        while at < len(tokens):
            lexeme = self._next(tokens, at, text)
            found.append(lexeme)
            at = lexeme.last
        return found

    def _next(self, tokens: Sequence[Token], at: int, text: str) -> Lexeme:
        def lexeme(end: int, tags: frozenset[str], time: TimePhrase | None = None) -> Lexeme:
            shown = " ".join(text[tokens[at].start : tokens[end - 1].end].split())
            words = tuple(token.word for token in tokens[at:end])
            return Lexeme(words, tags, at, end, shown, tokens[at].spoken, time)

        if (ranked := self._ranked(tokens, at)) is not None:
            end, words = ranked
            shown = " ".join(text[tokens[at].start : tokens[end - 1].end].split())
            return Lexeme(words, frozenset({"NOUN"}), at, end, shown, tokens[at].spoken)
        named = self._name(tokens, at)
        phrase, tags = self._phrase(tokens, at)
        if named <= at + 1 and (timed := time_at(tokens, at)) is not None and timed[0] > phrase:
            return lexeme(timed[0], frozenset({"TIME"}), timed[1])
        if named > at and named >= phrase:
            single = tags & _VERBAL if named == phrase == at + 1 else frozenset()
            numbered = {"NUM"} if named == at + 1 and tokens[at].word.isdecimal() else set()
            return lexeme(named, single | {"NOUN"} | numbered)
        if phrase > at + 1 and any(self._name(tokens, i) > phrase for i in range(at + 1, phrase)):
            phrase, tags = at + 1, self.phrases.get((tokens[at].word,), frozenset())
        if phrase > at + 1:
            return lexeme(phrase, tags)
        word = tokens[at].word
        if number_of(word) is not None:
            one = frozenset({"ONE"}) if tokens[at].spoken == "one" else frozenset()
            return lexeme(at + 1, tags | one | {"NUM"})
        if ordinal_of(word) is not None:
            return lexeme(at + 1, tags | {"ORD"})
        described, _ = self.lexicon.described(tokens, at, ENTITY_TYPES)
        if described > at:
            return lexeme(described, (tags if described == at + 1 else frozenset()) | {"NOUN"})
        if tokens[at].spoken == "ones":
            return lexeme(at + 1, frozenset({"ONE"}))
        if word == ",":
            return lexeme(at + 1, frozenset({"COMMA"}))
        if word in ".!?;":
            return lexeme(at + 1, frozenset({"END"}))
        return lexeme(at + 1, tags or frozenset({"UNK"}))

    def _ranked(self, tokens: Sequence[Token], at: int) -> tuple[int, Phrase] | None:
        """`top drawer of the dresser`, where a "first drawer of the dresser" is known."""
        tags = self.book.phrases.get((tokens[at].word,), frozenset())
        if not tags & {"ORD", "LAST"}:
            return None
        ranks = ("1st",) if "ORD" in tags else tuple(f"{n}th" for n in range(12, 3, -1))
        for rank in ranks if "ORD" in tags else (*ranks, "3rd", "2nd", "1st"):
            named = [Token(rank, rank, 0, 0), *tokens[at + 1 : at + 8]]
            end, _ = self.lexicon.exact(named, 0, ENTITY_TYPES)
            if end > 2:
                return at + end, tuple(token.word for token in named[:end])
        return None

    def _name(self, tokens: Sequence[Token], at: int) -> int:
        """Where the longest name ends that starts here.

        A name that only counts within a kind, "first cup", is left to the grammar.
        """
        lexicon = self.lexicon
        end, found = lexicon.exact(tokens, at, ENTITY_TYPES)
        if end == at:
            return at
        if any(entity.type in ("place", "robot") for entity in found):
            # "The packing table", of packing tables 1 and 2, is no table of the place "packing".
            return at if lexicon.begins_numbered(tokens, at) > end else end
        ordinal = ordinal_of(tokens[at].word)
        number = number_of(tokens[end - 1].word)
        if ordinal is not None and end > at + 1:
            kind = lexicon.kind(tokens, at + 1, end, ENTITY_TYPES)
            if kind is not None and all(e.ordinal == ordinal and e in kind[1] for e in found):
                return at
        if number is not None and end > at + 1:
            kind = lexicon.kind(tokens, at, end - 1, ENTITY_TYPES)
            if kind is not None and all(e.ordinal == number and e in kind[1] for e in found):
                return at
        return end

    def _phrase(self, tokens: Sequence[Token], at: int) -> tuple[int, frozenset[str]]:
        """The longest phrase of the language or of a skill that starts here."""
        longest = self._longest.get(tokens[at].word, 0)
        for length in range(min(longest, len(tokens) - at), 0, -1):
            tags = self.phrases.get(tuple(token.word for token in tokens[at : at + length]))
            if tags is not None:
                return at + length, tags
        return at, frozenset()


def tagger_of(vocabulary: Vocabulary) -> Tagger:
    """The tagger of a vocabulary: made once for the same names.

    Mappings that cannot change are the same only if they are the very same, which costs nothing.
    """
    mappings = (vocabulary.places, vocabulary.objects, vocabulary.robots)
    names = (
        vocabulary.wordbook,
        *(tuple(m.items()) if isinstance(m, MutableMapping) else m for m in mappings),
        vocabulary.skill_phrases,
        vocabulary.state_words,
    )
    return _LATEST.of(names, lambda: Tagger(vocabulary))


def _same(known: tuple[Any, ...], names: tuple[Any, ...]) -> bool:
    pairs = zip(known, names, strict=True)
    return all(one is other or (isinstance(one, tuple) and one == other) for one, other in pairs)


_LATEST: Latest[tuple[Any, ...], Tagger] = Latest(_same)
