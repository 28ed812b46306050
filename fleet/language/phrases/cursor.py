"""A place in the words of a text, and the ways to go on from there."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, reason_for, suggestion
from fleet.language.words.lexicon import ENTITY_TYPES, EntityType, Lexicon
from fleet.language.words.tokens import ORDINALS, SENTENCE_ENDS, Phrase, Token, tokens_of, words_of
from fleet.language.words.verb_senses import FINITE, IMPERATIVES
from fleet.language.words.wordlists import COPULAR_VERBS, FROM, IN, MODALS, TO

_PUNCTUATION = SENTENCE_ENDS | {","}
_BORDERS = _PUNCTUATION | {"and", "then", "to", "into", "onto", "from", "in", "on", "at"}
_BORDERS |= {"is", "are", "should", "has", "have"}
_BEHIND_SUBJECTS = COPULAR_VERBS | {",", "and", "or", "to", "has", "have", "belongs"}


class Cursor:
    """Walks over the words of one text; `at` counts tokens."""

    def __init__(self, text: str, lexicon: Lexicon, what: str = "a goal") -> None:
        """`what` is read: "a goal" or "a fact"."""
        self.what = what
        self.text = text
        self.lexicon = lexicon
        self.tokens = tokens_of(text)
        self.at = 0

    @property
    def line(self) -> str:
        """The whole text on one line."""
        return " ".join(self.text.split())

    @property
    def ended(self) -> bool:
        """Whether all words were read."""
        return self.at >= len(self.tokens)

    def word(self, ahead: int = 0) -> str:
        """The word so many tokens ahead; empty behind the end."""
        index = self.at + ahead
        return self.tokens[index].word if index < len(self.tokens) else ""

    def take(self, *words: str) -> bool:
        """Go past these words if they come next."""
        if all(self.word(i) == word for i, word in enumerate(words)):
            self.at += len(words)
            return True
        return False

    def take_joint(self) -> bool:
        """Go past what joins the items of a list: a comma, "and", or both."""
        return self.take(",", "and") or self.take("and") or self.take(",")

    def next_of(self, phrases: Iterable[Phrase]) -> Phrase | None:
        """The first of the phrases that comes next; nothing is gone past."""
        for phrase in phrases:
            if all(self.word(i) == word for i, word in enumerate(phrase)):
                return phrase
        return None

    def take_of(self, phrases: Iterable[Phrase]) -> Phrase | None:
        """Go past the first of the phrases that comes next, and return it."""
        phrase = self.next_of(phrases)
        self.at += len(phrase or ())
        return phrase

    def longest(self, phrases: Container[Phrase]) -> Phrase | None:
        """The longest of the phrases that comes next; nothing is gone past."""
        for length in range(4, 0, -1):
            phrase = tuple(self.word(i) for i in range(length))
            if phrase in phrases:
                return phrase
        return None

    def verb_next(self) -> bool:
        """Whether a verb that asks for something comes next, and no name that begins like one."""
        verb = self.longest(IMPERATIVES)
        if verb is None:
            return False
        end, named = self.lexicon.exact(self.tokens, self.at, ENTITY_TYPES)
        if not named:
            return True
        as_long = end == self.at + len(verb)
        if as_long and any(e.type == "robot" for e in named):
            return not self._subject_ends(len(verb))
        return end <= self.at + len(verb)

    def _subject_ends(self, ahead: int) -> bool:
        """Whether what stands so many words ahead can follow who does it: "Scout should …"."""
        start = self.at
        self.at += ahead
        found = (
            self.word() in _BEHIND_SUBJECTS
            or self.next_of(MODALS) is not None
            or self.longest(FINITE) is not None
        )
        self.at = start
        return found

    def take_word(self, words: Iterable[str]) -> str | None:
        """Go past the next word if it is one of these, and return it."""
        word = self.word()
        if word and word in words:
            self.at += 1
            return word
        return None

    def at_border(self) -> bool:
        """Whether the text, a sentence or a part between commas ends here."""
        return self.ended or self.word() in _PUNCTUATION

    def preposition(self) -> str | None:
        """Go past a preposition of place: `to`, `in` or `from`, whichever role it has."""
        for role, phrases in (("from", FROM), ("to", TO), ("in", IN)):
            if self.take_of(phrases):
                return role
        return None

    def quote(self, start: int, end: int | None = None) -> str:
        """The text of some tokens, as it was written."""
        chosen: Sequence[Token] = self.tokens[start : self.at if end is None else end]
        return " ".join(self.text[chosen[0].start : chosen[-1].end].split()) if chosen else ""

    def phrase(self) -> tuple[int, int]:
        """The tokens from here to the next border that a refusal should show."""
        end = self.at
        while end < len(self.tokens) and (end == self.at or self.tokens[end].word not in _BORDERS):
            end += 1
        return self.at, end

    def refusal(self, otherwise: str) -> NotUnderstood:
        """What is wrong with the words that come next; `otherwise` if nothing special is."""
        _, end = self.phrase()
        words = [
            (token.word, self.text[token.start : token.end])
            for token in self.tokens[self.at : end]
            if not (token.word in ("right", "left") and end - self.at > 1)
        ]
        special = reason_for(words, self.what)
        return NotUnderstood(special or otherwise)

    def unknown(self, what: str, types: Sequence[EntityType]) -> NotUnderstood:
        """The words that come next name nothing known of these types."""
        known = listed(self.lexicon.known(types))
        if self.ended:
            return NotUnderstood(f"{self.line!r} ends where {what} is missing; known are {known}")
        start, end = self.phrase()
        shown = self.quote(start, end)
        hint = ""
        names = self.lexicon.names_in(types) | set(ORDINALS)
        # What is known was hardly mistyped: a word that is not comes first.
        single = sorted(shown.split(), key=lambda word: word.casefold() in names)
        for part in (shown, " ".join(words_of(shown)), *single):
            if part.casefold() not in ORDINALS:
                hint = hint or suggestion(part, names)
        return self.refusal(f"{shown!r} is not a known {_bare(what)}{hint}; known are {known}")


def _bare(what: str) -> str:
    return what.removeprefix("a ").removeprefix("an ")
