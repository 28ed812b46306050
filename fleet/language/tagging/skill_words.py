"""Verbs and words for states that come with skills: "switch on", "the door is closed"."""

from __future__ import annotations

import re
from collections import defaultdict

from fleet.language.vocabulary import SkillPhrase, Vocabulary
from fleet.language.words.morphology import participles
from fleet.language.words.tokens import Phrase
from fleet.language.words.wordbook import VerbEntry, forms_of, phrase_of

SKILL = "skill"
"""The sense of a verb that asks for a skill."""


class SkillWords:
    """All verbs, those of the language and those of the skills, and the words for states."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        book = vocabulary.wordbook
        self.skills: dict[tuple[Phrase, Phrase], list[SkillPhrase]] = defaultdict(list)
        self.states: dict[Phrase, list[SkillPhrase]] = defaultdict(list)
        self.entries: dict[Phrase, list[VerbEntry]] = defaultdict(list)
        named = {phrase.verb for phrase in vocabulary.skill_phrases}
        for phrase in vocabulary.skill_phrases:
            same = tuple(v for v in book.same_verbs.get(phrase.verb, ()) if v not in named)
            for verb in (phrase.verb, *same, *map(_bare, phrase.says)):
                entry = book.entry(phrase_of(verb), frozenset({SKILL}))
                self.skills[entry.head, entry.behind].append(phrase)
                for participle in participles(entry.head[0]):
                    self._state((participle, *entry.head[1:], *entry.behind), phrase)
            for state in (*book.states.get(phrase.verb, ()), *phrase.states):
                self._state(phrase_of(state), phrase)
        for entry in book.verbs:
            self.entries[entry.head].append(entry)
        for head, behind in self.skills:
            self.entries[head].append(VerbEntry(head, behind, frozenset({SKILL})))
        self.forms: dict[Phrase, set[tuple[str, Phrase]]] = defaultdict(set)
        for head in self.entries:
            for tag, phrases in forms_of(head).items():
                for form in phrases:
                    self.forms[form].add((tag, head))
        self.particles = book.particles | {
            word for _, behind in self.skills for word in behind
        }

    def heads(self, words: Phrase, *tags: str) -> tuple[Phrase, ...]:
        """The verbs of which the words are a form."""
        return tuple(sorted({head for tag, head in self.forms.get(words, ()) if tag in tags}))

    def _state(self, words: Phrase, phrase: SkillPhrase) -> None:
        if phrase.type != "place" and phrase not in self.states[words]:
            self.states[words].append(phrase)


def _bare(says: str) -> str:
    """The words of a frame without its places: `turn {thing} off` is "turn off"."""
    return " ".join(re.sub(r"\[[^]]*\]|\{[^}]*\}", " ", says).split())
