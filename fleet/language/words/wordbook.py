"""The words of the language, from data files that a user can add to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import eq
from typing import Any

from fleet.language.words.latest import Latest
from fleet.language.words.morphology import gerund, participles, third_person
from fleet.language.words.own_words import SYNONYMS, OwnWords, shipped_verbs, shipped_words
from fleet.language.words.tokens import Phrase, tokens_of

_CONTRACTED = frozenset({"that", "it", "there", "what", "who", "where", "somebody", "someone"})
_GRAMMAR = frozenset(
    [
        "DET",
        "INDEF",
        "UNIV",
        "PRON",
        "BE",
        "AND",
        "OR",
        "THEN",
        "OF",
        "NOT",
        "THERE",
        "HERE",
        "HAVE",
        "BEEN",
        "PREP",
    ]
)


def phrase_of(text: str) -> Phrase:
    """A phrase of a data file as words; `#` and the like stand for themselves."""
    return tuple(token.word for token in tokens_of(text)) or (text,)


def forms_of(head: Phrase) -> dict[str, frozenset[Phrase]]:
    """The forms of a verb by the tag that the grammar knows them under."""
    verb, rest = head[0], head[1:]
    forms = {
        "VERB": (verb,),
        "FIN": (verb, third_person(verb)),
        "GER": (gerund(verb),),
        "PART": participles(verb),
    }
    return {tag: frozenset((form, *rest) for form in words) for tag, words in forms.items()}


@dataclass(frozen=True)
class VerbEntry:
    """One way to use a verb: its head, and the particles or the preposition behind it."""

    head: Phrase
    behind: tuple[Phrase, ...]
    senses: frozenset[str]

    @property
    def base(self) -> str:
        """The verb as a data file writes it."""
        return " ".join((*self.head, *(word for chunk in self.behind for word in chunk)))


def _contracted(phrase: Phrase) -> tuple[Phrase, ...]:
    """The same also with `'s`: "when that is done", "when that's done"."""
    for i in range(1, len(phrase)):
        if phrase[i] in ("is", "has") and phrase[i - 1] in _CONTRACTED:
            return phrase, (*phrase[:i], "'s", *phrase[i + 1 :])
    return (phrase,)


class Wordbook:
    """Words by tag, verbs by head, prepositions by role."""

    def __init__(self, words: Mapping[str, Iterable[str]], verbs: Mapping[str, Any]) -> None:
        found: dict[Phrase, set[str]] = defaultdict(set)
        self.remarks = tuple(map(phrase_of, words.get("REMARK", ())))
        for tag, phrases in words.items():
            if tag in ("REMARK", "EVERYDAY"):
                continue
            for text in phrases:
                for phrase in _contracted(phrase_of(text)):
                    found[phrase].add(tag)
        self.roles: dict[Phrase, str] = {}
        for role, prepositions in verbs["prepositions"].items():
            for text in prepositions:
                self.roles[phrase_of(text)] = role
                found[phrase_of(text)].add("PREP")
        self.particles = frozenset(verbs["particles"])
        for particle in self.particles:
            found[(particle,)].add("PARTICLE")
        self.rooms = tuple(tuple(map(phrase_of, group)) for group in verbs["rooms"])
        self.uses = frozenset(verbs["uses"])
        self.offering = frozenset(verbs["offering"])
        self.collective = frozenset(verbs["collective"])
        self.floors = frozenset(verbs["floors"])
        self.describing = frozenset(verbs["describing"])
        self.bins = tuple(map(phrase_of, verbs["bins"]))
        self.loading = frozenset(verbs["loading"])
        self.fetching = frozenset(verbs["fetching"])
        self.searched = frozenset(verbs["searched"])
        self.same_verbs: Mapping[str, Sequence[str]] = verbs.get(SYNONYMS, {})
        """Other ways to ask for a skill than its file has, by its verb."""
        senses: dict[Phrase, set[str]] = defaultdict(set)
        for sense, texts in verbs["verbs"].items():
            for text in texts:
                senses[phrase_of(text)].add(sense)
        self.verbs = tuple(self.entry(verb, frozenset(kinds)) for verb, kinds in senses.items())
        for use in self.uses:
            found[(use,)].add("USE")
        said = {word for phrase in (*found, *senses) for word in phrase}
        self.everyday = frozenset(words.get("EVERYDAY", ())) | said
        """Words that everybody knows, so that they are no slip of the pen for others."""
        self.phrases = {phrase: frozenset(tags) for phrase, tags in found.items()}
        self.grammar = frozenset(
            phrase[0]
            for phrase, tags in self.phrases.items()
            if len(phrase) == 1 and tags & _GRAMMAR
        )
        """Words that never count as a description of a thing; they may be part of a name."""

    def entry(self, verb: Phrase, senses: frozenset[str]) -> VerbEntry:
        """A verb with what stands behind its head apart from it."""
        end = next(
            (
                i
                for i, word in enumerate(verb)
                if i and (word in self.particles or (word,) in self.roles)
            ),
            len(verb),
        )
        return VerbEntry(verb[:end], tuple((word,) for word in verb[end:]), senses)


def wordbook_of(own: tuple[OwnWords, ...]) -> Wordbook:
    """The words that are shipped, with those of a user's own files added: made once for these."""
    if not own:
        return shipped_language()
    return _LATEST.of(own, lambda: _with_own(own))


def _with_own(own: tuple[OwnWords, ...]) -> Wordbook:
    words, verbs = shipped_words(), shipped_verbs()
    for more in own:
        for tag, phrases in more.lists.items():
            into = words if tag in words else verbs
            into[tag] = [*into[tag], *phrases]
        for name, groups in more.groups.items():
            for key, phrases in groups.items():
                known = verbs.get(name, {})
                verbs[name] = known | {key: [*known.get(key, ()), *phrases]}
        verbs["rooms"] = [*verbs["rooms"], *more.rooms]
    return Wordbook(words, verbs)


_LATEST: Latest[tuple[OwnWords, ...], Wordbook] = Latest(eq)


@cache
def shipped_language() -> Wordbook:
    """The words of every fleet."""
    return Wordbook(shipped_words(), shipped_verbs())
