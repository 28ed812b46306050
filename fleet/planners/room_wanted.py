"""What goals want that cannot be: more things than there is room for, two values of a variable."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator

from fleet.core.model.world import WorldModel, capacity
from keyexpr_schema.facts import AT, IN, ON, FactKey
from keyexpr_schema.payloads.goals import Condition


def lacks_room(conditions: Iterable[Condition], world: WorldModel) -> str | None:
    """What all of the conditions cannot hold together for, as a sentence; `None`: not for room.

    Only what carries a thing directly counts: things at a person may be there in one bowl.
    """
    wanted: dict[str, dict[str, None]] = defaultdict(dict)
    for condition in conditions:
        carrier = condition.value
        if (
            condition.relation in (ON, IN)
            and len(condition.subjects) == 1
            and isinstance(carrier, str)
            and carrier in world.objects
        ):
            wanted[carrier][condition.subject] = None
    wholes = {thing.part_of for thing in world.objects.values()}
    for carrier, things in wanted.items():
        room = capacity(carrier, world)
        if len(things) > room and carrier not in wholes:
            return f"{carrier} has room for {room:g}, and {', '.join(things)} are to be there"
    return None


def cannot_both_hold(
    conditions: Iterable[Condition], world: WorldModel
) -> tuple[Condition, Condition] | None:
    """Two conditions that want different values of one variable; of where a thing is only places
    that are no parts of each other."""
    wanted: dict[FactKey, Condition] = {}
    for condition in conditions:
        if condition.any_of or condition.negated:
            continue
        variable = FactKey(condition.relation, condition.subject)
        other = wanted.setdefault(variable, condition)
        if other.value != condition.value and _apart(variable, other, condition, world):
            return other, condition
    return None


def _apart(variable: FactKey, one: Condition, other: Condition, world: WorldModel) -> bool:
    if variable.relation not in (AT, ON, IN):
        return True
    around = [list(_wholes(each.value, world)) for each in (one, other)]
    return all(around) and one.value not in around[1] and other.value not in around[0]


def _wholes(place: object, world: WorldModel) -> Iterator[str]:
    """A place and what it is part of, nearest first; nothing of what is no place."""
    while isinstance(place, str) and place in world.places:
        yield place
        place = world.places[place].part_of
