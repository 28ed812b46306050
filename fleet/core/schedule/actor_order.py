"""Which of a robot's actors must come first, and which last."""

from __future__ import annotations

from fleet.core.checker.checked_plan import CheckedPlan
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import actor_arg, actor_in


def carried_at_end(checked: CheckedPlan) -> dict[str, str]:
    """Objects that the plan leaves with an actor, in its basket or hand, and which actor.

    Such actors come last: their robot would carry the object off.
    """
    holder: dict[str, Value] = {}
    for task in checked.graph.order:
        for literal in checked.actions[task].after:
            if literal.variable.relation == AT:
                holder[literal.variable.subject] = literal.value
    return {
        thing: actor for thing, value in holder.items() if (actor := actor_in(value)) is not None
    }


def first_actors(checked: CheckedPlan) -> frozenset[str]:
    """Actors that need their robot as it is now, and as some other actor would not leave it."""
    last = {actor_arg(actor) for actor in carried_at_end(checked).values()}
    leaves: dict[str, dict[str, Value]] = {}
    for task in checked.graph.order:
        for variable, value in checked.actions[task].after:
            leaves.setdefault(variable.subject, {})[variable.relation] = value
    left: dict[str, set[Value]] = {}
    for subject, rows in leaves.items():
        if subject not in last:
            for relation, value in rows.items():
                left.setdefault(relation, set()).add(value)
    return frozenset(
        actor
        for actor, requirement in checked.requirements.items()
        if any(
            left.get(relation, set()) - {value}
            for relation, (value, _) in requirement.facts.items()
        )
    )
