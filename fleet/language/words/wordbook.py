"""The words of the language, from data files that a user can add to."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from fleet.errors import BadLanguageFile
from fleet.language.words.morphology import gerund, participles, third_person
from fleet.language.words.tokens import Phrase, tokens_of

_CONTRACTED = frozenset({"that", "it", "there", "what", "who", "where", "somebody", "someone"})
_SHIPPED = Path(__file__).parent.parent / "data"
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
        self.everyday = frozenset(words.get("EVERYDAY", ()))
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
        self.bins = tuple(map(phrase_of, verbs["bins"]))
        self.fetching = frozenset(verbs["fetching"])
        self.searched = frozenset(verbs["searched"])
        self.same_verbs = {verb: tuple(same) for verb, same in verbs["same_verbs"].items()}
        self.states = {verb: tuple(same) for verb, same in verbs["states"].items()}
        senses: dict[Phrase, set[str]] = defaultdict(set)
        for sense, texts in verbs["verbs"].items():
            for text in texts:
                senses[phrase_of(text)].add(sense)
        self.verbs = tuple(self.entry(verb, frozenset(kinds)) for verb, kinds in senses.items())
        for use in self.uses:
            found[(use,)].add("USE")
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


def read_language(*own: Path) -> Wordbook:
    """The words that are shipped, with those of a user's own files added.

    A file has tags with phrases (`words.yaml`), or `verbs`, `prepositions`, … (`verbs.yaml`).

    Raises:
        BadLanguageFile: one sentence that names the file and what is wrong in it.
    """
    words = _mapping(_SHIPPED / "words.yaml")
    verbs = _mapping(_SHIPPED / "verbs.yaml")
    for path in own:
        for name, more in _mapping(path).items():
            into = words if name in words else verbs if name in verbs else None
            if into is None:
                known = ", ".join(sorted({*words, *verbs}))
                raise BadLanguageFile(f"{path}: there is no {name!r}; known are {known}")
            into[name] = _joined(into[name], more, f"{path}: {name}")
    return Wordbook(words, verbs)


def _mapping(path: Path) -> dict[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise BadLanguageFile(f"{path} cannot be read: {reason}") from None
    if not isinstance(data, dict):
        raise BadLanguageFile(f"{path}: there must be a mapping of tags to lists of phrases")
    return data


def _joined(shipped: Any, more: Any, where: str) -> Any:
    if isinstance(shipped, dict) and isinstance(more, dict):
        return shipped | {
            key: _joined(shipped[key], value, f"{where}: {key}") if key in shipped else value
            for key, value in more.items()
        }
    if isinstance(shipped, list) and isinstance(more, list):
        return [*shipped, *more]
    raise BadLanguageFile(f"{where} must be a list of phrases, in quotes where YAML needs them")


@cache
def shipped_language() -> Wordbook:
    """The words of every fleet."""
    return read_language()
