"""What leaves a world that is replaced by a file's, and what of that is in use. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from cli.client.fleet_view import FleetView
from keyexpr_schema.facts import AT, HOLDING, FactKey, render_value
from keyexpr_schema.payloads.goals import ENDED_GOALS, Condition
from keyexpr_schema.payloads.tasks import ENDED_TASKS


@dataclass(frozen=True)
class Leaving:
    """Places, objects, doors and zones that the file does not name, and the facts of them and at
    them.

    What a robot says of itself stays: its worker would say it again.
    """

    places: tuple[str, ...]
    objects: tuple[str, ...]
    facts: tuple[FactKey, ...]
    regions: tuple[str, ...] = ()


def leaving(
    view: FleetView,
    known_places: Collection[str],
    known_objects: Collection[str],
    places: Collection[str],
    objects: Collection[str],
    known_regions: Collection[str] = (),
    regions: Collection[str] = (),
) -> Leaving:
    """What of the known places, objects and regions the new ones leave out."""
    gone_places = tuple(sorted(name for name in known_places if name not in places))
    gone_objects = tuple(sorted(name for name in known_objects if name not in objects))
    gone = {*gone_places, *gone_objects} - {*places, *objects}
    facts = tuple(
        key
        for key, fact in sorted(view.facts.items())
        if key.subject in gone or (fact.value in gone and key.subject not in view.robot_specs)
    )
    gone_regions = tuple(sorted(name for name in known_regions if name not in regions))
    return Leaving(gone_places, gone_objects, facts, gone_regions)


def in_use(view: FleetView, leaves: Leaving) -> list[str]:
    """A sentence for each thing that is under way with what leaves."""
    gone = {*leaves.places, *leaves.objects}
    return [
        *_tasks(view, gone),
        *_goals(view, gone),
        *_robots(view, gone),
        *_closures(view, gone.union(leaves.regions)),
    ]


def _tasks(view: FleetView, gone: set[str]) -> Iterator[str]:
    for (plan, task), record in sorted(view.tasks.items()):
        named = gone.intersection(record.args.values())
        if named and record.state not in ENDED_TASKS:
            yield f"task {plan}/{task} ({record.skill}) is {record.state.value} with {_and(named)}"


def _goals(view: FleetView, gone: set[str]) -> Iterator[str]:
    for goal, status in sorted(view.goal_status.items()):
        conditions = (*status.conditions, *(each for stage in status.stages for each in stage))
        named = {name for each in conditions for name in _names(each)} & gone
        if named and status.state not in ENDED_GOALS:
            yield f"goal {goal} ({status.state.value}) is about {_and(named)}"


def _robots(view: FleetView, gone: set[str]) -> Iterator[str]:
    for robot in sorted(view.robot_specs):
        for relation, words in ((AT, "is at"), (HOLDING, "holds")):
            fact = view.facts.get(FactKey(relation, robot))
            if fact is not None and fact.value in gone:
                yield f"robot {robot} {words} {render_value(fact.value)}"


def _closures(view: FleetView, gone: set[str]) -> Iterator[str]:
    for closure in view.standing_closures():
        if named := gone.intersection(closure.names[:1]):
            yield f"{_and(named)} is closed ({closure.closure})"


def _names(condition: Condition) -> Iterator[str]:
    yield from condition.subjects
    if isinstance(condition.value, str):
        yield condition.value


def _and(names: set[str]) -> str:
    return ", ".join(sorted(names))
