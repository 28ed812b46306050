"""Why a text is not understood: the first word that is not, or where it ends."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, nearest, reason_for, suggestion
from fleet.language.resolve.frames import EXAMPLE, SAY_IT
from fleet.language.segments import Segment, Sentence
from fleet.language.tagging.lexicon import ENTITY_TYPES
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.words.tokens import Token

_BEFORE_NOUNS = frozenset({"DET", "INDEF", "UNIV", "NUM", "ORD", "ADJ", "OTHER", "ANOTHER"})
_REFUSED_OF_GOALS = ("IF", "WHEN", "UNLESS", "UNTIL", "BEFORE", "AFTER", "TIME", "DONT", "NEVER",
                     "AVOID", "WITHOUT", "ALWAYS", "NOT")  # fmt: skip


class Explanations:
    """Says why parts of one text are not understood."""

    def __init__(self, text: str, tokens: Sequence[Token], tagger: Tagger, mode: str) -> None:
        self.text, self.tokens, self.tagger, self.mode = text, tokens, tagger, mode

    def what(self) -> str:
        return "a fact" if self.mode == "fact" else "a goal"

    def check(self, sentence: Sentence) -> None:
        if self.mode != "goal":
            return
        for word in sentence.words:
            if any(tag in word.tags for tag in _REFUSED_OF_GOALS) and "NOUN" not in word.tags:
                spoken = [(t.word, self.text[t.start : t.end]) for t in
                          self.tokens[word.first : word.last]]  # fmt: skip
                special = reason_for(spoken, self.what())
                if special:
                    raise NotUnderstood(special)
                raise NotUnderstood(f"{word.text!r} is nothing that {self.what()} can say yet")

    def unheard_of(self, segment: Segment) -> None:
        """Whether a word stands there that is refused wherever it stands."""
        if any("UNK" in w.tags and not reason_for([(w.word, w.text)]) for w in segment.words):
            return  # what nobody knows comes first
        for word in segment.words:
            if word.tags & {"UNK", "UNTIL", "MIGHT"} and (
                special := reason_for([(word.word, word.text)], self.what())
            ):
                raise NotUnderstood(special)

    def ungrammatical(self, segment: Segment, at: int) -> NotUnderstood:
        """Why nothing was made of the words: the first that is not known, or where it ends."""
        words = segment.words
        strange = [i for i, w in enumerate(words) if "UNK" in w.tags or w.tags <= {"USE"}]
        example = SAY_IT if self.mode == "fact" else EXAMPLE
        if strange:
            unheard = [i for i in strange if not reason_for([(words[i].word, words[i].text)])]
            at = (unheard or strange)[0]
        elif at >= len(words) and "PREP" in words[-1].tags:
            known = listed(self.tagger.lexicon.known(("place",)))
            return NotUnderstood(
                f"{self.quote(words)!r} ends where a place is missing; known are {known}"
            )
        end = at + 1
        while end < len(words) and words[end - 1].tags & _BEFORE_NOUNS:
            end += 1
        shown = words[at:end] or words[-1:]
        odd = [w for w in shown if not w.tags & {"VERB", "NOUN"}]
        special = reason_for([(w.word, w.text) for w in odd], self.what())
        if not special and not strange:
            rest = [w for w in words if not w.tags & {"ME", "PEOPLE", "VERB", "NOUN"}]
            special = reason_for([(w.word, w.text) for w in rest], self.what())
        if special:
            return NotUnderstood(special)
        if at >= len(words):
            return NotUnderstood(f"{self.quote(words)!r} ends before it says all: {example}")
        begins = at
        while begins and words[begins - 1].tags & _BEFORE_NOUNS:
            begins -= 1
        if strange and (begins < at or (at and "PREP" in words[at - 1].tags)):
            hint = suggestion(words[at].text, self.tagger.lexicon.names_in(ENTITY_TYPES))
            known = nearest(self.tagger.lexicon.known(ENTITY_TYPES), words[at].text)
            text = self.quote(words[begins : at + 1])
            return NotUnderstood(
                f"{text!r} is not a known object, robot or place{hint}; known are {known}"
            )
        text = self.quote(shown)
        if at == 0:
            verbs = {e.base for entries in self.tagger.verbs.entries.values() for e in entries}
            hint = suggestion(words[0].word, verbs) if strange else ""
            return NotUnderstood(f"{text!r} is not understood as {self.what()}{hint}: {example}")
        return NotUnderstood(f"{text!r} is not understood after {self.quote(words[:at])!r}")

    def quote(self, words: Sequence[Lexeme]) -> str:
        start = self.tokens[words[0].first].start
        return " ".join(self.text[start : self.tokens[words[-1].last - 1].end].split())
