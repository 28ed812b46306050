"""Whether goals want more things on or in something than it has room for."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from fleet.core.model.world import WorldModel, capacity
from keyexpr_schema.facts import IN, ON
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
