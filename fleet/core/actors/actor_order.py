"""Which of a robot's actors must come first, and which last."""

from __future__ import annotations

from collections import defaultdict

from fleet.core.checker.plan_checker import CheckedPlan
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg, actor_in


def carried_at_end(checked: CheckedPlan) -> dict[str, str]:
    """Objects that the plan leaves with an actor, in its basket or hand, and which actor.

    Such actors come last: their robot would carry the object off.
    """
    return {
        key.subject: actor
        for key, value in checked.effects.items()
        if key.relation == AT and (actor := actor_in(value)) is not None
    }


def first_actors(checked: CheckedPlan) -> frozenset[str]:
    """Actors that need their robot as it is now, and as some other actor would not leave it."""
    last = {actor_arg(actor) for actor in carried_at_end(checked).values()}
    left: dict[str, set[Value]] = defaultdict(set)
    for (relation, subject), value in checked.effects.items():
        if subject not in last:
            left[relation].add(value)
    return frozenset(
        actor
        for actor, requirement in checked.requirements.items()
        if any(left[relation] - {value} for relation, (value, _) in requirement.facts.items())
    )
