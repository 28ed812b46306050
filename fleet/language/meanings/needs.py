"""What a method of a task needs: whether it is there, and in words what is missing."""

from __future__ import annotations

import re
from collections.abc import Mapping

from fleet.errors import NotUnderstood
from fleet.language.methods.model import SKILL_NEED, Method, filled
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.morphology import plurals
from keyexpr_schema.payloads.world import Feature

_NEED = re.compile(r"(?:(\d+)\s+)?(.+)")
_PURPOSE: dict[str, str] = {
    Feature.SUPPORTS.value: "to put things on",
    Feature.CONTAINS.value: "to put things in",
}


def check_needs(method: Method, given: Mapping[str, str], vocabulary: Vocabulary) -> None:
    """Whether all is there that a method needs.

    Raises:
        NotUnderstood: it is not; one sentence says what is missing.
    """
    for need in method.needs:
        text = filled(need, given)
        if text.startswith(f"{SKILL_NEED} "):
            skill = text.split()[1]
            if not vocabulary.can(skill):
                raise NotUnderstood(f"no skill {skill} is known")
            continue
        match = _NEED.fullmatch(text)
        assert match is not None
        least, type_ = int(match[1] or 1), match[2]
        found = len(vocabulary.of_type(type_))
        if found < least:
            raise NotUnderstood(_missing(type_, least, found, vocabulary))


def _missing(type_: str, least: int, found: int, vocabulary: Vocabulary) -> str:
    """`it takes 2 forks, and there is only 1`, `there is no coffee machine to put things on`."""
    if found or least > 1:
        there = f"there {'is' if found == 1 else 'are'} {f'only {found}' if found else 'none'}"
        return f"it takes {least} {_named(type_, many=least > 1)}, and {there}"
    return f"there is no {_named(_lacking(type_, vocabulary), many=False)}"


def _lacking(type_: str, vocabulary: Vocabulary) -> str:
    """The part of `coffee_machine & supports` of which there is none, if there is one."""
    if "|" in type_:
        return type_
    kinds = (w for w in map(str.strip, type_.split("&")) if not (w in _PURPOSE or _is_adjective(w)))
    return next((kind for kind in kinds if not vocabulary.of_type(kind)), type_)


def _named(type_: str, many: bool) -> str:
    """A type as people say it: `movable dishes`, `cups or glasses`."""
    return " or ".join(_one_of(each, many) for each in type_.split("|"))


def _one_of(type_: str, many: bool) -> str:
    words = [word.strip() for word in type_.split("&")]
    purposes = [_PURPOSE[word] for word in words if word in _PURPOSE]
    adjectives = [word for word in words if _is_adjective(word)]
    nouns = [w.replace("_", " ") for w in words if w not in (*_PURPOSE, *adjectives)] or ["thing"]
    if many:
        nouns[-1] = _plural(nouns[-1])
    return " ".join((*adjectives, *nouns, *purposes))


def _is_adjective(word: str) -> bool:
    """Whether a type is a feature that says what can be done: `movable`, `washable`."""
    return word.endswith(("able", "ible")) and word != "table"


def _plural(noun: str) -> str:
    first, last = noun.rpartition(" ")[::2]
    if last.endswith("s") and not last.endswith(("ss", "us")):  # clothes
        return noun
    form = max(plurals(last), key=lambda each: (each.endswith(("ves", "oes")), each))
    return f"{first} {form}".strip()
