"""From plain sentences to facts and goal conditions, by grammar and the names that exist.

Sentences are matched against a small grammar; noun phrases against the labels, aliases, kinds and
ordinals of the places, objects and robots that exist. What is not understood is refused with a
sentence that lists the candidates: nothing is dropped silently.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fleet.errors import NotUnderstood
from keyexpr_schema.goals import Condition
from keyexpr_schema.robots import RobotSpec
from keyexpr_schema.world import Object, Place

ORDINALS = {
    "first": 1,
    "second": 2,
    "third": 3,
    "fourth": 4,
    "fifth": 5,
    "sixth": 6,
    "seventh": 7,
    "eighth": 8,
    "ninth": 9,
    "tenth": 10,
}
_ARTICLES = re.compile(r"\b(?:the|a|an|my|our|please)\b")
_BRING = re.compile(
    r"^(?:bring|take|deliver|carry|move|fetch|transport|put|place|get)\s+(?P<what>.+?)\s+"
    r"(?:to|into|in|onto|on|at)\s+(?P<where>.+)$"
)
_GO = re.compile(
    r"^(?:send|drive|move)\s+(?P<who>.+?)\s+to\s+(?P<where>.+)$|"
    r"^(?P<who2>.+?)[,:]?\s+(?:should\s+)?(?:go|goes|drive|drives|navigate|navigates)\s+to\s+"
    r"(?P<where2>.+)$"
)
_IS_AT = re.compile(
    r"^(?:there\s+(?:is|are)\s+)?(?P<what>.+?)\s+(?:(?:is|are|lies|lie|stands|stand)\s+)?"
    r"(?:in|at|on|inside)\s+(?P<where>.+)$"
)


@dataclass(frozen=True)
class Vocabulary:
    """The names that sentences can use."""

    places: Mapping[str, Place]
    objects: Mapping[str, Object]
    robots: Mapping[str, RobotSpec]

    def place(self, phrase: str) -> str:
        """The place that a phrase names.

        Raises:
            NotUnderstood: it names none; the message lists those that exist.
        """
        names = {name: (p.label, *p.aliases) for name, p in self.places.items()}
        found = _named(phrase, names)
        if len(found) == 1:
            return found[0]
        raise NotUnderstood(_unclear("place", phrase, found, self.places))

    def robot(self, phrase: str) -> str | None:
        """The robot that a phrase names, or `None`."""
        found = _named(phrase, {name: (spec.label,) for name, spec in self.robots.items()})
        return found[0] if len(found) == 1 else None

    def things(self, phrase: str) -> tuple[str, ...]:
        """The objects that a phrase names: one, or all of a kind for "all cups", "both cups".

        Raises:
            NotUnderstood: it names none, or does not say which of several.
        """
        text = _plain(phrase)
        names = {name: (o.label, *o.aliases) for name, o in self.objects.items()}
        found = _named(text, names)
        if len(found) == 1:
            return found
        if several := re.fullmatch(r"(?:all|both|every|each|all of|both of)\s+(.+)", text):
            members = self._of_kind(several[1])
            if members:
                return tuple(members)
        if counted := re.fullmatch(r"(\w+)\s+(.+)", text):
            ordinal = ORDINALS.get(counted[1])
            for name in self._of_kind(counted[2]) if ordinal else ():
                if self.objects[name].ordinal == ordinal:
                    return (name,)
        if counted := re.fullmatch(r"(.+?)\s+(?:number\s+)?(\d+)", text):
            for name in self._of_kind(counted[1]):
                if self.objects[name].ordinal == int(counted[2]):
                    return (name,)
        members = self._of_kind(text)
        if len(members) == 1:
            return tuple(members)
        raise NotUnderstood(_unclear("object", phrase, members or found, self.objects))

    def _of_kind(self, text: str) -> list[str]:
        kinds = {text, text.removesuffix("s"), text.removesuffix("es")}
        members = [thing for thing in self.objects.values() if _plain(thing.kind) in kinds]
        return [thing.object for thing in sorted(members, key=lambda o: (o.ordinal, o.object))]


def goal_conditions(text: str, words: Vocabulary) -> tuple[Condition, ...]:
    """The conditions that a goal sentence asks for.

    Understood are "bring … to …" and its synonyms, "send … to …", "… go to …", and several such
    parts joined by "and", where a later part may leave the verb out.

    Raises:
        NotUnderstood: the sentence, or one of its names, is not understood.
    """
    found: list[Condition] = []
    verb = ""
    for part in _parts(text):
        conditions = _goal_part(part, words) or _goal_part(f"{verb} {part}", words)
        if not conditions:
            raise NotUnderstood(
                f"{text.strip()!r} is not understood as a goal: say it like "
                '"bring the first cup to the hallway" or "send the robot to the kitchen"'
            )
        verb = part.split()[0] if _BRING.match(part) else verb
        found.extend(conditions)
    wanted: dict[tuple[str, str], Condition] = {}
    for condition in found:
        before = wanted.setdefault((condition.relation, condition.subject), condition)
        if before.value != condition.value:
            raise NotUnderstood(
                f"{text.strip()!r} wants {condition.subject} in two places: "
                f"{before.value} and {condition.value}"
            )
    return tuple(wanted.values())


def _goal_part(part: str, words: Vocabulary) -> list[Condition]:
    if match := _GO.match(part):
        robot = words.robot(match["who"] or match["who2"])
        if robot is not None:
            where = words.place(match["where"] or match["where2"])
            return [Condition(relation="at", subject=robot, value=where)]
    if match := _BRING.match(part):
        things = words.things(match["what"])
        where = words.place(match["where"])
        return [Condition(relation="at", subject=thing, value=where) for thing in things]
    return []


def statement_facts(text: str, words: Vocabulary) -> tuple[tuple[str, str, str], ...]:
    """The facts in a statement, as (relation, subject, value).

    Understood are "… is in …" and "there are … in …".

    Raises:
        NotUnderstood: the sentence, or one of its names, is not understood.
    """
    found: list[tuple[str, str, str]] = []
    for part in _parts(text):
        match = _IS_AT.match(part)
        if match is None:
            raise NotUnderstood(
                f"{text.strip()!r} is not understood as a fact: say it like "
                '"the first cup is in the kitchen"'
            )
        where = words.place(match["where"])
        robot = words.robot(match["what"])
        subjects = (robot,) if robot is not None else words.things(match["what"])
        found.extend(("at", subject, where) for subject in subjects)
    return tuple(found)


def _parts(text: str) -> list[str]:
    plain = _plain(text)
    parts = [
        part for part in re.split(r"\s*(?:[;.]|,?\s+(?:and then|and|then)\s+)\s*", plain) if part
    ]
    if not parts:
        raise NotUnderstood("the sentence is empty: say what you want")
    return parts


def _plain(text: str) -> str:
    lowered = re.sub(r"[_\s]+", " ", text.lower()).strip(" .!?\"'")
    return re.sub(r"\s+", " ", _ARTICLES.sub(" ", lowered)).strip()


def _named(phrase: str, names: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    text = _plain(phrase)
    return tuple(
        name
        for name, others in names.items()
        if text in {_plain(name), *(_plain(other) for other in others if other)}
    )


def _unclear(what: str, phrase: str, found: Iterable[str], known: Iterable[str]) -> str:
    several = sorted(found)
    if several:
        return f"{phrase.strip()!r} could be {' or '.join(several)}: say which {what}"
    names = ", ".join(sorted(known)) or "none yet"
    return f"{phrase.strip()!r} is not a known {what}; known are {names}"
