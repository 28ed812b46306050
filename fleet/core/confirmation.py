"""Which readings of a paraphrase a person has to confirm before anything is done."""

from __future__ import annotations

import re
from collections.abc import Iterable

from fleet.core.model.skills import SkillModel
from fleet.core.state import State
from fleet.language import Confirm, Reading, WantedGoal
from fleet.language.words.folding import folded
from fleet.language.words.restrictions import restricts
from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, SEARCHED
from keyexpr_schema.payloads.goals import Condition, Goal

FEW = 3
"""So many conditions are not many."""
_ALWAYS_UNDONE = frozenset({AT, ON, IN, HELD, LOCATED, SEARCHED})
"""Where things are, and what is known of them, can be brought back."""
_NO_NAMES = frozenset(
    [
        "a",
        "an",
        "the",
        "of",
        "in",
        "on",
        "at",
        "to",
        "by",
        "for",
        "from",
        "with",
        "and",
        "or",
        "i",
        "m",
    ]
)
"""Words that occur in names, and name nothing."""


def to_confirm(state: State, goal: Goal, reading: Reading) -> bool:
    """Whether what a language model made of a goal's sentence is asked about first."""
    confirm = state.policy.confirm
    return confirm is Confirm.ALWAYS or (
        confirm is Confirm.COARSE and is_coarse(state, goal, reading)
    )


def is_coarse(state: State, goal: Goal, reading: Reading) -> bool:
    """Whether a reading of other words than those of a goal could do much harm if it is not meant.

    That is: it wants more than `FEW` conditions, or something again and again, or tells a fact, or
    wants something that no skill can undo, or speaks of something of which the goal's own words
    name nothing, or not of something that they name; or the goal's own words deny, leave out, or
    say when: whether that is kept in other words, nobody has looked.
    """
    if restricts(goal.text, state.vocabulary().wordbook):
        return True
    goals = reading.goals
    wanted = [
        *(row for each in goals for stage in each.stages for row in stage),
        *(row for each in goals for row in (*each.always, *each.never)),
    ]
    if (
        len(wanted) > FEW
        or reading.facts
        or any(each.every is not None or each.whenever for each in goals)
    ):
        return True
    spoken = _words([goal.text])
    if not _says_of_all(state, goal, reading, spoken):
        return True
    return not all(
        _is_named(state, goal, row, spoken) and _can_be_undone(state.skills.values(), row)
        for row in wanted
    )


def _can_be_undone(skills: Iterable[SkillModel], wanted: Condition) -> bool:
    """Whether some skill makes it otherwise."""
    if wanted.relation in _ALWAYS_UNDONE:
        return True
    effects = (
        (variable.relation, value)
        for skill in skills
        for variable, value in (
            *skill.after,
            *((each.variable, each.value) for each in skill.conditional),
        )
    )
    return any(relation == wanted.relation and value != wanted.value for relation, value in effects)


def _is_named(state: State, goal: Goal, wanted: Condition, spoken: frozenset[str]) -> bool:
    """Whether words of the sentence occur in the names of what is wanted, and of where."""
    where = (wanted.value,) if isinstance(wanted.value, str) else ()
    return any(_names(state, each) & spoken for each in wanted.subjects) and all(
        each == goal.speaker or not _names(state, each) or _names(state, each) & spoken
        for each in where
    )


def _says_of_all(state: State, goal: Goal, reading: Reading, spoken: frozenset[str]) -> bool:
    """Whether of every name of which a word is spoken something is said, and no robot is asked for
    that is not named."""
    meant = {goal.speaker, *(name for each in reading.goals for name in _spoken_of(each))}
    for (_, subject), value in reading.presumed:
        meant |= {subject, value}
    known = (*state.places, *state.objects, *state.robots)
    named = {name: words for name in known if (words := _names(state, name) & spoken)}
    missing = (
        frozenset[str]()
        .union(*named.values())
        .difference(*(words for name, words in named.items() if name in meant))
    )
    asked = {robot for each in reading.goals for robot in each.by}
    return not missing and asked <= named.keys()


def _spoken_of(wanted: WantedGoal) -> Iterable[object]:
    """All names that a goal speaks of, and other values of its conditions."""
    yield from wanted.by
    rows = (*wanted.always, *wanted.never, *wanted.when, *wanted.only_if, *wanted.whenever)
    for row in (*(row for stage in wanted.stages for row in stage), *rows):
        yield from (*row.subjects, row.value)


def _names(state: State, name: str) -> frozenset[str]:
    """All words in what something is called; none of what is no thing, place or robot."""
    if (place := state.places.get(name)) is not None:
        return _words([name, place.label, *place.aliases])
    if (thing := state.objects.get(name)) is not None:
        return _words([name, thing.label, thing.kind, *thing.aliases, *thing.categories])
    robot = state.robots.get(name)
    return _words([name, robot.label]) if robot is not None else frozenset()


def _words(texts: Iterable[str]) -> frozenset[str]:
    """Words in any case, without the s of many; numbers say nothing."""
    found = (word for text in texts for word in re.findall(r"[^\W\d_]+", folded(text)))
    return frozenset(word.removesuffix("s") for word in found) - _NO_NAMES
