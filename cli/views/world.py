"""Places, objects, facts and statements as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table

from cli.views.console import table
from cli.views.text import seconds, statement_means
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement, StatementStatus


def places_table(places: Sequence[Place]) -> Table:
    """One line a place."""
    return table(
        ["place", "label", "also called", "surfaces", "distances"],
        (
            (
                place.place,
                place.label,
                ", ".join(place.aliases),
                ", ".join(surface.surface for surface in place.surfaces),
                ", ".join(f"{to} {m:.1f} m" for to, m in place.travel_m.items()),
            )
            for place in places
        ),
        title="Places",
    )


def objects_table(objects: Sequence[Object]) -> Table:
    """One line an object."""
    return table(
        ["object", "kind", "label", "also called", "mass", "home", "features"],
        (
            (
                o.object,
                o.kind,
                o.label,
                ", ".join(o.aliases),
                f"{o.mass_kg:g} kg",
                o.home,
                ", ".join(_features(o)),
            )
            for o in objects
        ),
        title="Objects",
    )


def _features(thing: Object) -> list[str]:
    """What can be done with it, and what it is a part of."""
    fixed = [] if thing.movable else ["fixed"]
    part = [] if thing.part_of is None else [f"part of {thing.part_of}"]
    room = [] if thing.room is None else [f"room for {thing.room:g}"]
    return [*thing.features, *fixed, *part, *room]


def facts_table(facts: Sequence[Fact]) -> Table:
    """One line a fact."""
    return table(
        ["fact", "source", "time"],
        ((str(fact.literal), fact.source, seconds(fact.time_s)) for fact in facts),
        title="Facts",
    )


def statements_table(statements: Sequence[Statement], read: Mapping[str, StatementStatus]) -> Table:
    """One line a statement, with what the planner read out of it."""
    return table(
        ["statement", "text", "source", "read as"],
        (
            (
                each.statement,
                each.text,
                each.source,
                statement_means(read.get(each.statement)).removeprefix(", "),
            )
            for each in statements
        ),
        title="Statements",
    )
