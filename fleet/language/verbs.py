"""The verbs that goals use, in the forms that sentences use."""

from __future__ import annotations

from collections.abc import Container
from enum import Enum

from fleet.language.cursor import Cursor
from fleet.language.lexicon import Sort
from fleet.language.morphology import gerund, participles, third_person
from fleet.language.tokens import tokens_of
from fleet.language.wordlists import MODALS, STANDING

Phrase = tuple[str, ...]


class Doing(Enum):
    """What a verb asks for."""

    MOVE = "move"
    FETCH = "fetch"  # MOVE, and where to may be said later
    GO = "go"
    FIND = "find"
    SEARCH = "search"
    PICK = "pick"
    GIVE = "give"
    TIDY = "tidy"
    PATROL = "patrol"  # SEARCH, or going from place to place if a robot is named


_VERBS: dict[Doing, tuple[str, tuple[str, ...]]] = {
    Doing.MOVE: (
        "bring take deliver carry move transport return get fetch haul transfer relocate shift "
        "put place set lay stow store leave collect gather retrieve drop deposit load send drive",
        ("put down", "set down", "lay down", "drop off"),
    ),
    Doing.FETCH: ("take get fetch collect gather retrieve", ()),
    Doing.GO: ("go navigate head travel proceed come drive move return", ()),
    Doing.FIND: ("find locate seek spot detect", ("look for", "search for", "hunt for")),
    Doing.SEARCH: (
        "search inspect check explore patrol survey scan scout examine",
        (
            "look around",
            "look around in",
            "look around inside",
            "look round",
            "look round in",
            "look in",
            "look into",
            "look inside",
            "look through",
            "look at",
            "have a look",
            "have a look around",
            "have a look round",
            "have a look in",
            "take a look",
            "take a look around",
            "take a look round",
            "take a look in",
            "check out",
            "search in",
            "search through",
            "patrol through",
        ),
    ),
    Doing.PATROL: ("patrol", ("patrol through",)),
    Doing.PICK: (
        "grab grasp lift hold pick",
        ("pick up", "lift up", "take hold of", "get hold of", "grab hold of"),
    ),
    Doing.GIVE: ("give hand pass", ("hand over", "give over", "pass over")),
    Doing.TIDY: (
        "tidy return",
        (
            "tidy up",
            "clean up",
            "clear up",
            "put away",
            "put back",
            "bring back",
            "take back",
            "carry back",
        ),
    ),
}


def _forms_of(make: str) -> dict[Phrase, frozenset[Doing]]:
    found: dict[Phrase, frozenset[Doing]] = {}
    for doing, (single, several) in _VERBS.items():
        for verb in (*single.split(), *several):
            head, _, rest = verb.partition(" ")
            forms = {
                "imperative": (head, gerund(head)),
                "finite": (head, third_person(head), gerund(head)),
                "participle": participles(head),
            }[make]
            for form in forms:
                phrase = tuple(token.word for token in tokens_of(f"{form} {rest}"))
                found[phrase] = found.get(phrase, frozenset()) | {doing}
    return found


IMPERATIVES = _forms_of("imperative")
"""What "bring" or (after "would you mind") "bringing" may ask for."""
FINITE = _forms_of("finite")
"""What may follow somebody who does it: "goes", "go"."""
PARTICIPLES = _forms_of("participle")
"""What may follow "should be": "brought"."""
PARTICLES = frozenset({"back", "away", "up", "over", "down", "off"})
"""What may stand behind the thing that a verb is about: "pick it up", "put it back"."""
EXAMPLE = 'say it like "bring the first cup to the hallway" or "send a robot to the kitchen"'
_BEHIND_SUBJECTS = STANDING | {",", "and", "or", "to", "has", "have", "belongs"}
_ALL_SORTS: tuple[Sort, ...] = ("object", "robot", "place", "surface")


def longest(cursor: Cursor, phrases: Container[Phrase]) -> Phrase | None:
    """The longest of the phrases that comes next; nothing is gone past."""
    for length in range(4, 0, -1):
        phrase = tuple(cursor.word(i) for i in range(length))
        if phrase in phrases:
            return phrase
    return None


def verb_next(cursor: Cursor) -> bool:
    """Whether a verb comes next that asks for something, and not a name that begins like one."""
    verb = longest(cursor, IMPERATIVES)
    if verb is None:
        return False
    end, named = cursor.lexicon.exact(cursor.tokens, cursor.at, _ALL_SORTS)
    if not named:
        return True
    as_long = end == cursor.at + len(verb)
    if as_long and any(e.sort == "robot" for e in named):
        return not _subject_ends(cursor, len(verb))
    return end <= cursor.at + len(verb)


def _subject_ends(cursor: Cursor, ahead: int) -> bool:
    """Whether what stands so many words ahead can follow who does it: "Scout should …"."""
    start = cursor.at
    cursor.at += ahead
    found = (
        cursor.word() in _BEHIND_SUBJECTS
        or cursor.next_of(MODALS) is not None
        or longest(cursor, FINITE) is not None
    )
    cursor.at = start
    return found


BASE_VERBS = frozenset(
    verb for single, several in _VERBS.values() for verb in (*single.split(), *several)
)
"""What a mistyped verb may have meant."""
