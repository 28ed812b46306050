"""Verbs and words for states that come with skills: "switch on", "the door is closed"."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from fleet.language.vocabulary import SkillPhrase, StateWord, Vocabulary
from fleet.language.words.morphology import participles
from fleet.language.words.tokens import Phrase
from fleet.language.words.wordbook import VerbEntry, forms_of, phrase_of

SKILL = "skill"
"""The sense of a verb that asks for a skill."""
_PART = re.compile(r"\[([^]]*)\]|\{([^}]*)\}|([^[{]+)")
_SLOT = re.compile(r"{([^}]*)}")
_ROOM = 64
"""Frames that one line of `says` may stand for."""


@dataclass(frozen=True)
class SkillFrame:
    """One way to ask for a skill: the verb, phrases beside it, and the parameter that may be named
    as its tool."""

    phrase: SkillPhrase
    head: Phrase
    behind: tuple[Phrase, ...]
    tool: str = ""


class SkillWords:
    """All verbs, those of the language and those of the skills, and the words for states."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        book = vocabulary.wordbook
        self.skills: dict[tuple[Phrase, tuple[Phrase, ...]], list[SkillFrame]] = defaultdict(list)
        self.states: dict[Phrase, list[StateWord]] = defaultdict(list)
        self.entries: dict[Phrase, list[VerbEntry]] = defaultdict(list)
        self.literals: set[Phrase] = set()
        for state in vocabulary.state_words:
            self.states[phrase_of(state.word)].append(state)
        named = {phrase.verb for phrase in vocabulary.skill_phrases}
        for phrase in vocabulary.skill_phrases:
            same = tuple(v for v in book.same_verbs.get(phrase.verb, ()) if v not in named)
            for verb in (phrase.verb, *same):
                entry = book.entry(phrase_of(verb), frozenset({SKILL}))
                self._add(SkillFrame(phrase, entry.head, entry.behind))
            for says in phrase.says:
                for frame in _frames(phrase, says):
                    self._add(frame)
        for entry in book.verbs:
            self.entries[entry.head].append(entry)
        for head, behind in self.skills:
            self.entries[head].append(VerbEntry(head, behind, frozenset({SKILL})))
        self.forms: dict[Phrase, set[tuple[str, Phrase]]] = defaultdict(set)
        for head in self.entries:
            for tag, phrases in forms_of(head).items():
                for form in phrases:
                    self.forms[form].add((tag, head))

    def heads(self, words: Phrase, *tags: str) -> tuple[Phrase, ...]:
        """The verbs of which the words are a form."""
        return tuple(sorted({head for tag, head in self.forms.get(words, ()) if tag in tags}))

    def _add(self, frame: SkillFrame) -> None:
        frames = self.skills[frame.head, frame.behind]
        if frame not in frames:
            frames.append(frame)
        self.literals.update(frame.behind)
        for participle in participles(frame.head[0]):
            words = (participle, *frame.head[1:], *(w for chunk in frame.behind for w in chunk))
            self._state(words, frame.phrase)

    def _state(self, words: Phrase, phrase: SkillPhrase) -> None:
        for relation, value in phrase.wants:
            state = StateWord(
                word=" ".join(words), type=phrase.type, relation=relation, value=value
            )
            if state not in self.states[words]:
                self.states[words].append(state)


def _frames(phrase: SkillPhrase, says: str) -> Iterator[SkillFrame]:
    """The frames that a line stands for: `[…]` may be left out, `a|b` is one of them."""
    choices: list[list[tuple[str, str]]] = []
    for optional, slot, plain in _PART.findall(says):
        if slot:
            choices.append([("slot", slot)])
        elif plain.strip():
            choices.append([("words", text) for text in _alternatives(plain.strip())])
        elif optional:
            kind = "tool" if "{" in optional else "words"
            kept = [(kind, text) for text in optional.split("|") if text.strip()]
            choices.append([("words", ""), *kept])
    for number, chosen in enumerate(product(*choices)):
        if number >= _ROOM:
            return
        chunks = [phrase_of(text) for kind, text in chosen if kind == "words" and text]
        tool = next((_SLOT.findall(text)[0] for kind, text in chosen if kind == "tool"), "")
        head, behind = chunks[0][:1], chunks[1:]
        rest = chunks[0][1:]
        yield SkillFrame(phrase, head, tuple([rest, *behind] if rest else behind), tool)


def _alternatives(text: str) -> list[str]:
    """`sanitise|sanitize now`: each of the texts that it stands for."""
    return [" ".join(words) for words in product(*(word.split("|") for word in text.split()))]
