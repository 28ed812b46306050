"""The verbs that goals use, in the forms that sentences use, and the conditions they ask for."""

from __future__ import annotations

from enum import Enum

from fleet.language.words.morphology import gerund, participles, third_person
from fleet.language.words.tokens import Phrase, tokens_of


class VerbSense(Enum):
    """What a verb asks for, as the condition that shall hold."""

    MOVE = "move"  # at(object) = place: `goals.moving`, as GO and GIVE
    FETCH = "fetch"  # MOVE, and where to may be said later
    GO = "go"  # at(robot) = place
    FIND = "find"  # located(object) = true: `goals.clauses`, as SEARCH and PICK
    SEARCH = "search"  # searched(place) = true
    PICK = "pick"  # held(object) = true
    GIVE = "give"  # at(object) = robot
    TIDY = "tidy"  # at(object) = its home: `goals.tidying`
    PATROL = "patrol"  # SEARCH, or going from place to place if a robot is named


_VERBS: dict[VerbSense, str] = {
    VerbSense.MOVE: (
        "bring|take|deliver|carry|move|transport|return|get|fetch|haul|transfer|relocate|shift|"
        "put|place|set|lay|stow|store|leave|collect|gather|retrieve|drop|deposit|load|send|drive|"
        "put down|set down|lay down|drop off"
    ),
    VerbSense.FETCH: "take|get|fetch|collect|gather|retrieve",
    VerbSense.GO: "go|navigate|head|travel|proceed|come|drive|move|return",
    VerbSense.FIND: "find|locate|seek|spot|detect|look for|search for|hunt for",
    VerbSense.SEARCH: (
        "search|inspect|check|explore|patrol|survey|scan|scout|examine|look around|"
        "look around in|look around inside|look round|look round in|look in|look into|"
        "look inside|look through|look at|have a look|have a look around|have a look round|"
        "have a look in|take a look|take a look around|take a look round|take a look in|"
        "check out|search in|search through|patrol through"
    ),
    VerbSense.PATROL: "patrol|patrol through",
    VerbSense.PICK: (
        "grab|grasp|lift|hold|pick|pick up|lift up|take hold of|get hold of|grab hold of"
    ),
    VerbSense.GIVE: "give|hand|pass|hand over|give over|pass over",
    VerbSense.TIDY: (
        "tidy|return|tidy up|clean up|clear up|put away|put back|bring back|take back|carry back"
    ),
}


def _forms_of(make: str) -> dict[Phrase, frozenset[VerbSense]]:
    found: dict[Phrase, frozenset[VerbSense]] = {}
    for sense, verbs in _VERBS.items():
        for verb in verbs.split("|"):
            head, _, rest = verb.partition(" ")
            forms = {
                "imperative": (head, gerund(head)),
                "finite": (head, third_person(head), gerund(head)),
                "participle": participles(head),
            }[make]
            for form in forms:
                phrase = tuple(token.word for token in tokens_of(f"{form} {rest}"))
                found[phrase] = found.get(phrase, frozenset()) | {sense}
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
BASE_VERBS = frozenset(verb for verbs in _VERBS.values() for verb in verbs.split("|"))
"""What a mistyped verb may have meant."""
