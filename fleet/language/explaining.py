"""Why a text is not understood: the first word that is not, or where it ends."""

from __future__ import annotations

import re
from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import (
    HOW_TO_REST,
    SUBORDINATE,
    Misused,
    alike,
    listed,
    nearest,
    nothing_of_it,
    reason_for,
    suggestion,
)
from fleet.language.resolve.frames import ASK_IT, EXAMPLE, SAY_IT, no_use, nothing_said
from fleet.language.sentences.segments import Segment, Sentence
from fleet.language.tagging.lexicon import ENTITY_TYPES
from fleet.language.tagging.skill_words import SKILL
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tagging.task_phrases import begun
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.tokens import Token

_BEFORE_NOUNS = frozenset({"DET", "INDEF", "UNIV", "NUM", "ORD", "ADJ", "OTHER", "ANOTHER"})
_ASKING = frozenset(
    {"WHERE", "WHAT", "WHICH", "WHO", "HOWMANY", "ISARE", "DO", "MODAL", "BE", "WAS", "HAVE"}
)
"""With one of these a question begins; "could you" and the like are no more there."""
_NEVER_READ = frozenset({"UNTIL", "MIGHT", "SUPPOSED", "MANNER", "CANCEL"})
_NAMED_BY_TAG = ("SUPPOSED", "MANNER")
_NAMES = frozenset(
    {"NOUN", "DET", "INDEF", "UNIV", "NUM", "ORD", "PREP", "ADJ", "PEOPLE", "ME", "I"}
)
_HALT = frozenset({"stop", "halt", "freeze"})
_ALL_OF_IT = frozenset(
    [
        *("all", "every", "everything", "everybody", "everyone", "robot", "robots", "the", "of"),
        *("you", "it", "that", "this", "them", "moving", "working", "doing", "right", "now"),
        *("at", "once", "immediately", "please", "stop", "halt", "everywhere", "there", "here"),
    ]
)
"""With nothing but these behind it, that word is for the robots, and no goal."""
_SHOWN_TOGETHER = 3
"""Unknown words in a row that are named together."""
_REFUSED_OF_GOALS = ("IF", "WHEN", "WHENEVER", "UNLESS", "ASLONGAS", "OTHERWISE", "UNTIL", "BEFORE",
                     "AFTER", "TIME", "HOWOFTEN", "DONT", "NEVER", "AVOID", "WITHOUT", "ALWAYS",
                     "NOT")  # fmt: skip


class Explanations:
    """Says why parts of one text are not understood."""

    def __init__(
        self,
        text: str,
        tokens: Sequence[Token],
        tagger: Tagger,
        mode: str,
        vocabulary: Vocabulary,
    ) -> None:
        self.text, self.tokens, self.tagger, self.mode = text, tokens, tagger, mode
        self.vocabulary, self.tasks = vocabulary, vocabulary.tasks

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
        said = [token.word for word in segment.words for token in
                self.tokens[word.first : word.last]]  # fmt: skip
        if said[0] in _HALT and _ALL_OF_IT.issuperset(said[1:]):
            raise Misused(f"{self.quote(segment.words)!r} is nothing to be planned: {HOW_TO_REST}")
        unheard = self._unheard(segment.words)
        for i, word in enumerate(segment.words):
            if unheard is not None and i > unheard:
                return  # what nobody knows comes first
            refused = word.tags & _NEVER_READ and "VERB" not in word.tags
            if refused or ("UNK" in word.tags and unheard is None):
                named = next((t.casefold() for t in _NAMED_BY_TAG if t in word.tags), word.word)
                if special := reason_for([(named, word.text)], self.what()):
                    kind = Misused if word.tags & _NEVER_READ else NotUnderstood
                    raise kind(special)

    def _unheard(self, words: Sequence[Lexeme]) -> int | None:
        """The first word that nobody knows; not of what only says why or when."""
        for i, word in enumerate(words):
            if word.word in SUBORDINATE:
                return None
            if "UNK" in word.tags and not reason_for([(word.word, word.text)]):
                return self._as_what(words, i)
        return None

    @staticmethod
    def _as_what(words: Sequence[Lexeme], at: int) -> int:
        """`as gently as you can`: not the first of these is at fault, but what stands behind."""
        behind = words[at + 1].tags if at + 1 < len(words) else frozenset()
        return at + 1 if words[at].words == ("as",) and behind & {"UNK", "ADJ"} else at

    def rather(
        self, problem: NotUnderstood, segments: Sequence[Segment], sentences: Sequence[Sentence]
    ) -> NotUnderstood:
        """What to say of a text in which nothing was made of the first of the segments.

        A word that nobody knows comes before what else is wrong, wherever it stands in what was
        not read yet; then what somebody shall be told or asked.
        """
        if isinstance(problem, Misused):
            return problem
        later = [segment for sentence in sentences for segment in sentence.segments]
        for number, segment in enumerate((*segments, *later)):
            at = self._unheard(segment.words)
            if not number and (misused := self._misused(segment.words, at)) is not None:
                return misused
            if at is not None:
                named = re.search(rf"\b{re.escape(segment.words[at].text)}\b", str(problem))
                return problem if named else self.ungrammatical(segment, at)
        return problem

    @staticmethod
    def _measured(words: Sequence[Lexeme], at: int) -> int:
        """Where the unknown thing stands of which "a bag of blood" is so much."""
        what = at + 1
        while what < len(words) and words[what].tags & (_BEFORE_NOUNS | {"OF"}):
            what += 1
        of = any("OF" in word.tags for word in words[at + 1 : what])
        return what if of and what < len(words) and "UNK" in words[what].tags else at

    def _misused(self, words: Sequence[Lexeme], unheard: int | None) -> NotUnderstood | None:
        """What is wrong with a use of a known word that stands before the first unknown one."""
        last = len(words) if unheard is None else unheard
        if unheard is not None and last > 1 and self._as_verb(words):
            text = self.quote(words[:1])
            return nothing_said(text, self.mode)
        for i, word in enumerate(words[:last]):
            if i and self._as_command(words, i):
                text = self.quote(words[i : i + 1])
                return nothing_said(text, self.mode)
            if "TELL" in word.tags and words[i + 1 :] and self._of_telling(words[i + 1 :]):
                end = i + 2
                while end < len(words) and words[end - 1].tags & _BEFORE_NOUNS:
                    end += 1
                return NotUnderstood(
                    f"{self.quote(words[i:end])!r} wants somebody to be told or asked something, "
                    'which no robot does; say "tell ROBOT to …" for what a robot shall do'
                )
        return None

    @staticmethod
    def _of_telling(rest: Sequence[Lexeme]) -> bool:
        """Whether what follows "tell" is no order to somebody."""
        for word in rest:
            if word.tags & {"TO", "VERB"}:
                return False
            if word.tags & {"COMMA", "AND", "THEN"}:
                break
        return True

    def ungrammatical(self, segment: Segment, at: int) -> NotUnderstood:
        """Why nothing was made of the words: the first that is not known, or where it ends."""
        words = segment.words
        strange = [i for i, w in enumerate(words) if "UNK" in w.tags or w.tags <= {"USE"}]
        asked = bool(words[0].tags & _ASKING) and self.mode != "fact"
        what = "a question" if asked else self.what()
        example = SAY_IT if self.mode == "fact" else ASK_IT if asked else EXAMPLE
        unheard = [i for i in strange if not reason_for([(words[i].word, words[i].text)])]
        if unheard and self._is_like_a_task(words, unheard[0]):
            whole = words if len(words) <= _SHOWN_TOGETHER else words[: unheard[0] + 1]
            named = self.quote(whole[-_SHOWN_TOGETHER:])
            tasks = alike([task.shown for task in self.tasks], named)
            return NotUnderstood(
                f"nothing is known of {named!r}; tasks known are {tasks}; teach it in a file of "
                "tasks (`robotctl planner --tasks FILE`)"
            )
        if strange:
            at = self._as_what(words, self._measured(words, (unheard or strange)[0]))
        elif at >= len(words) and "PREP" in words[-1].tags:
            known = listed(self.tagger.lexicon.known(("place",)))
            return NotUnderstood(
                f"{self.quote(words)!r} ends where a place is missing; known are {known}"
            )
        end = at + 1
        while end < len(words) and words[end - 1].tags & _BEFORE_NOUNS:
            end += 1
        if 0 < at < len(words) and not strange and self._wants_more(words[at - 1]):
            return no_use(self.tagger, words[at - 1], self.quote(words[at - 1 : end]))
        while at in unheard and end in unheard and end < at + _SHOWN_TOGETHER:
            end += 1
        shown = words[at:end] or words[-1:]
        odd = [w for w in shown if not w.tags & {"VERB", "NOUN"}]
        special = reason_for([(w.word, w.text) for w in odd], self.what())
        if not special and not strange:
            rest = [w for w in words if not w.tags & {"ME", "PEOPLE", "VERB", "NOUN"}]
            special = reason_for([(w.word, w.text) for w in rest], self.what())
        if special:
            return NotUnderstood(special)
        if at >= len(words) and words[-1].tags & {"FLOOR", "ONE", "PARTICLE"} and len(words) > 1:
            at = len(words) - 1  # "the fourth floor"
        if at >= len(words):
            return NotUnderstood(f"{self.quote(words)!r} ends before it says all: {example}")
        begins = at
        while (
            begins
            and words[begins - 1].tags & _BEFORE_NOUNS
            and not words[begins - 1].tags & {"VERB", "PARTICLE"}
            and not _numbered(words[:begins])
        ):
            begins -= 1
        if strange and (begins < at or (at and "PREP" in words[at - 1].tags)):
            names = self.tagger.lexicon.names_in(ENTITY_TYPES)
            hint = suggestion(words[at].text, names, self.tagger.book.everyday)
            known = nearest(self.tagger.lexicon.known(ENTITY_TYPES), words[at].text)
            text = self.quote(words[begins:end])
            of = self.tagger.entities(words[end].words) if end < len(words) else ()
            if of and begins < at and not hint and "VERB" not in words[end].tags:
                entire = self.quote(words[begins : end + 1])
                return nothing_of_it(words[at].text, entire, (e.id for e in of))
            return NotUnderstood(
                f"{text!r} is not a known object, robot or place{hint}; known are {known}"
            )
        if not strange and at and self._as_verb(words):
            at, shown = 0, words[:1]
        if at == 0:
            text = f"{self.quote(shown)!r}"
            verbs = {e.base for entries in self.tagger.verbs.entries.values() for e in entries}
            hint = suggestion(words[0].word, verbs, self.tagger.book.everyday) if strange else ""
            if asked:
                text = f"{self.quote(words)!r}"
                if len(words) > _SHOWN_TOGETHER:
                    said = [w for w in words if not w.tags & _ASKING] or words
                    text = f"{self.quote(said[-1:])!r} in {text}"
            return NotUnderstood(f"{text} is not understood as {what}{hint}: {example}")
        after = self.quote(words[:at])
        return NotUnderstood(f"{self.quote(shown)!r} is not understood after {after!r}")

    def beside_a_task(self, problem: NotUnderstood, segment: Segment) -> NotUnderstood:
        """What to say of a clause of which nothing was made, if it begins with a task's phrase."""
        words = segment.words
        if not self.tasks or self.mode == "fact" or self._unheard(words) is not None:
            return problem
        call = begun(words, self.tokens, self.text, self.vocabulary, self.tagger)
        rest = words[len(call.parts) :] if call is not None else ()
        if call is None or not rest:
            return problem
        shown = self.quote(rest[:_SHOWN_TOGETHER])
        return NotUnderstood(f"{shown!r} is not understood after {call.text!r}, which is a task")

    def _is_like_a_task(self, words: Sequence[Lexeme], unheard: int) -> bool:
        """`make pancakes`: whether it asks for something that has a name, and nobody knows it."""
        if self.mode == "fact" or not self.tasks or len(words) < 2:
            return False
        first, *rest = words
        verbs = self.tagger.verbs
        heads = verbs.heads(first.words, "VERB")
        entries = [e for head in heads for e in verbs.entries[head]]
        behind = {chunk for entry in entries for chunk in entry.behind}
        if any(word.words in behind for word in rest):
            return False  # "turn on the lights" is asked of a thing that nobody knows
        entries = [entry for entry in entries if not entry.behind]
        senses = {sense for entry in entries for sense in entry.senses}
        calls = {said.split()[0] for task in self.tasks for said in task.says}
        if senses and not (senses == {SKILL} and first.word in calls):
            return False
        asks = "VERB" in first.tags or "UNK" in first.tags or first.word in calls
        if (
            not asks
            or first.tags & _NAMES
            or not rest[-1].tags & {"UNK", "NOUN"}  # "turn the lights off"
            or any(not w.tags & (_BEFORE_NOUNS | {"UNK"}) for w in rest)
        ):
            return False
        named = self.tagger.lexicon.names_in(ENTITY_TYPES) if unheard else {
            entry.base for entries in verbs.entries.values() for entry in entries
        }  # fmt: skip
        return not suggestion(words[unheard].word, named, self.tagger.book.everyday)

    def _wants_more(self, word: Lexeme) -> bool:
        """`turn`: whether it is a verb only with a word behind it."""
        verbs = self.tagger.verbs
        entries = [e for head in verbs.heads(word.words, "VERB") for e in verbs.entries[head]]
        return bool(entries) and all(entry.behind for entry in entries)

    def asks_for(self, segment: Segment) -> bool:
        """`book meeting room 1`: whether an unknown word begins it that is used as a verb."""
        first, *rest = segment.words
        unheard = self._unheard(segment.words)
        if unheard is not None and self._is_like_a_task(segment.words, unheard):
            return True
        named = bool(rest) and bool(rest[0].tags & (_BEFORE_NOUNS | {"NOUN"}))
        return "UNK" in first.tags and named

    @staticmethod
    def _as_command(words: Sequence[Lexeme], at: int) -> bool:
        """`wash the plates, dry them`: whether a word that tells states is used as a verb."""
        joined = words[at - 1].tags & {"COMMA", "AND", "THEN"}
        state = words[at].tags & {"ADJ", "PART"} and not words[at].tags & {"VERB", "NOUN", "PREP"}
        behind = words[at + 1].tags if at + 1 < len(words) else frozenset()
        return bool(joined and state and behind & {"PRON", "DET"})

    @staticmethod
    def _as_verb(words: Sequence[Lexeme]) -> bool:
        """`print the contract`: whether a name begins it that is used as a verb."""
        one = len(words[0].words) == 1
        bare = one and "NOUN" in words[0].tags and not words[0].tags & {"VERB", "ADJ"}
        return (
            bare
            and len(words) > 1
            and (bool(words[1].tags & (_BEFORE_NOUNS - {"ADJ"})) and not words[1].text.isdigit())
        )  # not of "parcel 3 weighs"

    def quote(self, words: Sequence[Lexeme]) -> str:
        start = self.tokens[words[0].first].start
        return " ".join(self.text[start : self.tokens[words[-1].last - 1].end].split())


def _numbered(words: Sequence[Lexeme]) -> bool:
    """Whether they end with a thing and its number: "parcel 3"."""
    return len(words) > 1 and "NUM" in words[-1].tags and "NOUN" in words[-2].tags
