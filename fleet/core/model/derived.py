"""Where things are, as it follows from what carries them: the one module that knows how.

One variable says where a thing is: `at(x)` is what carries it *directly*, a place, a thing, a robot
or a person. All else is read off that, and never stored:

- `at(x) = p` holds for all that carries x: its carrier, what carries or has that as a part, and so
  on, up to the outermost place. What a hand holds is at that robot or person, and nowhere else.
- `on(x) = c` and `in(x) = c`: its carrier is the thing c, or a part of it.
- `reachable(x)`: nothing that carries it, however indirectly, is closed, and nothing that is in the
  way of it or of what carries it is open.
- `located(x)`, `held(x)`: something carries it; a robot's hand does.

What a skill needs to be `at` a place is not in a robot's basket: it would have to be taken out
first. A *goal* (`aboard`) also holds while it is in the basket of a robot that is there.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterator, Mapping
from typing import Protocol

from keyexpr_schema.facts import (
    AT,
    BLOCKED_BY,
    HELD,
    HOLDING,
    IN,
    IS_OPEN,
    LOCATED,
    ON,
    REACHABLE,
    FactKey,
    Literal,
    Value,
)
from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.world import Feature, Object, Place

DERIVED = frozenset({LOCATED, HELD, REACHABLE})
"""Relations that no fact says and no skill makes true."""
READ_OFF = {
    AT: frozenset({AT, HOLDING}),
    ON: frozenset({ON, AT}),
    IN: frozenset({IN, AT}),
    LOCATED: frozenset({AT}),
    HELD: frozenset({AT, HOLDING}),
    REACHABLE: frozenset({AT, HOLDING, IS_OPEN, BLOCKED_BY}),
}
"""The relations of the variables that `read_by` names, for those that may have others."""
_GOOD_FOR = {ON: Feature.SUPPORTS, IN: Feature.CONTAINS}


class Inventory(Protocol):
    """What exists, whatever is believed of it: `WorldModel` and the planner's state are such."""

    @property
    def places(self) -> Mapping[str, Place]: ...
    @property
    def objects(self) -> Mapping[str, Object]: ...
    @property
    def robots(self) -> Container[str]: ...


ValueOf = Callable[[FactKey], Value]
ValuesOf = Callable[[FactKey], Collection[Value]]


def written(literal: Literal, world: Inventory) -> Literal:
    """The literal of the one variable that is written where somebody says this one: of `on` or `in`
    a thing (or a robot) that exists it is `at`."""
    (relation, subject), carrier = literal
    if relation in _GOOD_FOR and isinstance(carrier, str) and _carries(carrier, world):
        return Literal(FactKey(AT, subject), carrier)
    return literal


def _carries(name: str, world: Inventory) -> bool:
    return name in world.objects or is_robot(name, world)


def is_robot(name: Value, world: Inventory) -> bool:
    """Whether a value stands for a robot: by its name, or as an actor."""
    return isinstance(name, str) and (name in world.robots or actor_in(name) is not None)


def is_hand(name: str, carried: str, value_of: ValueOf, world: Inventory) -> bool:
    """Whether what is directly at `name` is in a hand: a person's, or a robot's that holds it."""
    thing = world.objects.get(name)
    if thing is not None:
        return thing.is_a(Feature.PERSON)
    return is_robot(name, world) and value_of(FactKey(HOLDING, name)) == carried


def carriers(
    subject: str, value_of: ValueOf, world: Inventory, *, aboard: bool = False
) -> Iterator[str]:
    """What carries it, the direct carrier first, the outermost place last. It ends at a hand, and
    unless `aboard` at any robot."""
    seen, here = {subject}, carrier_of(subject, value_of, world)
    while here is not None and here not in seen:
        yield here
        if not carries_on(here, subject, value_of, world, aboard=aboard):
            return
        seen.add(here)
        subject, here = here, carrier_of(here, value_of, world)


def carries_on(
    carrier: str, carried: str, value_of: ValueOf, world: Inventory, *, aboard: bool
) -> bool:
    """Whether what carries the direct `carrier` of something carries that, too: see `carriers`."""
    if is_robot(carrier, world) and not aboard:
        return False
    return not is_hand(carrier, carried, value_of, world)


def carrier_of(name: str, value_of: ValueOf, world: Inventory) -> str | None:
    """What carries it directly, as far as it is known."""
    if (whole := _part_of(name, world)) is not None:
        return whole
    if name in world.places:
        return None
    value = value_of(FactKey(AT, name))
    return value if isinstance(value, str) else stays_at(name, world)


def stays_at(name: str, world: Inventory) -> str | None:
    """Where a thing that does not move is if nothing else is known: where it belongs."""
    thing = world.objects.get(name)
    fixed = thing is not None and not thing.movable and not thing.is_a(Feature.PERSON)
    return thing.home if thing is not None and fixed else None


def _part_of(name: str, world: Inventory) -> str | None:
    thing = world.objects.get(name)
    if thing is not None:
        return thing.part_of
    place = world.places.get(name)
    return None if place is None else place.part_of


def is_part(name: str, whole: str, world: Inventory) -> bool:
    """Whether `name` is `whole`, or a fixed part of it, or of a part of it."""
    seen: set[str] = set()
    here: str | None = name
    while here is not None and here not in seen:
        if here == whole:
            return True
        seen.add(here)
        here = _part_of(here, world)
    return False


def holds(literal: Literal, value_of: ValueOf, world: Inventory, *, aboard: bool = False) -> bool:
    """Whether a literal holds where the variables that are stored have the values `value_of` says.

    `aboard`: as a goal, for which a robot's basket is where the robot is.
    """
    (relation, subject), wanted = literal
    if relation == LOCATED:
        return is_located(subject, value_of, world) is wanted
    if relation == HELD:
        return (_holder(subject, value_of, world) is not None) is wanted
    if relation == REACHABLE:
        return _reachable(subject, value_of, world) is wanted
    if relation in _GOOD_FOR and isinstance(wanted, str) and _carries(wanted, world):
        return _is_on(relation, subject, wanted, value_of, world)
    if relation == AT and isinstance(wanted, str):
        return wanted in carriers(subject, value_of, world, aboard=aboard)
    return value_of(literal.variable) == wanted


def is_located(subject: str, value_of: ValueOf, world: Inventory) -> bool:
    """Whether it is known what carries it."""
    return carrier_of(subject, value_of, world) is not None


def _holder(subject: str, value_of: ValueOf, world: Inventory) -> str | None:
    robot = value_of(FactKey(AT, subject))
    held = isinstance(robot, str) and value_of(FactKey(HOLDING, robot)) == subject
    return str(robot) if held else None


def _is_on(relation: str, subject: str, whole: str, value_of: ValueOf, world: Inventory) -> bool:
    carrier = value_of(FactKey(AT, subject))
    if not isinstance(carrier, str) or not is_part(carrier, whole, world):
        return False
    thing = world.objects.get(carrier)
    if thing is None:
        return True
    return thing.is_a(_GOOD_FOR[relation]) or not any(map(thing.is_a, _GOOD_FOR.values()))


def is_closed(name: str, value_of: ValueOf, world: Inventory) -> bool:
    """Whether nobody can reach into it: it opens, and is not known to be open."""
    thing = world.objects.get(name)
    return (
        thing is not None
        and thing.is_a(Feature.OPENABLE)
        and value_of(FactKey(IS_OPEN, name)) is not True
    )


def _reachable(subject: str, value_of: ValueOf, world: Inventory) -> bool:
    chain = [subject, *carriers(subject, value_of, world, aboard=True)]
    if any(is_closed(carrier, value_of, world) for carrier in chain[1:]):
        return False
    # What is in the way at a cabinet's top is not at its drawers.
    wholes = {whole for name in chain if (whole := _part_of(name, world)) is not None}
    return not any(
        thing not in chain and value_of(FactKey(IS_OPEN, thing)) is True
        for name in chain
        if name not in wholes
        for thing in _in_the_way(name, lambda key: (value_of(key),), world)
    )


def reachable_if(subject: str, value_of: ValueOf, world: Inventory) -> str | bool:
    """Whether something that moves can be reached, or the name of what carries it, if that is so
    where that can be; no such thing may be in the way of hands."""
    here = carrier_of(subject, value_of, world)
    if here is None or here not in world.objects:
        return True
    if is_closed(here, value_of, world):
        return False
    return here if carries_on(here, subject, value_of, world, aboard=True) else True


def _in_the_way(name: str, values_of: ValuesOf, world: Inventory) -> Iterator[str]:
    """What hands at a thing meet while it is open."""
    thing = world.objects.get(name)
    if thing is None:
        return
    yield from thing.blocked_by
    if not thing.movable:
        found = (value for value in values_of(FactKey(BLOCKED_BY, name)) if value != name)
        yield from (value for value in found if isinstance(value, str))


def read_by(
    literal: Literal, values_of: ValuesOf, world: Inventory, *, aboard: bool = False
) -> set[FactKey]:
    """The stored variables that `holds` may look at, where each may have the values `values_of`
    says; more than it does look at, perhaps, and never fewer."""
    (relation, subject), wanted = literal
    where = FactKey(AT, subject)
    if relation == LOCATED:
        return {where}
    if relation == HELD:
        holders = (v for v in values_of(where) if isinstance(v, str))
        return {where, *(FactKey(HOLDING, holder) for holder in holders)}
    if relation == REACHABLE or (relation == AT and isinstance(wanted, str)):
        around = _read_around(subject, values_of, world, aboard or relation == REACHABLE)
        if relation == AT:
            return around
        opened = {key.subject for key in around} | {
            str(value) for key in around if key.relation == AT for value in values_of(key)
        }
        wholes = {whole for name in opened for whole in _wholes(name, world)}
        things = {name for name in opened | wholes if name in world.objects}
        for name in (*things, subject):
            around |= {FactKey(IS_OPEN, other) for other in _in_the_way(name, values_of, world)}
            if name in world.objects and not world.objects[name].movable:
                around.add(FactKey(BLOCKED_BY, name))
        return around | {
            FactKey(IS_OPEN, name)
            for name in things
            if name != subject and world.objects[name].is_a(Feature.OPENABLE)
        }
    if relation in _GOOD_FOR and isinstance(wanted, str) and _carries(wanted, world):
        return {where}
    return {literal.variable}


def _wholes(name: str, world: Inventory) -> Iterator[str]:
    seen: set[str] = set()
    here = _part_of(name, world)
    while here is not None and here not in seen:
        yield here
        seen.add(here)
        here = _part_of(here, world)


def _read_around(subject: str, values_of: ValuesOf, world: Inventory, aboard: bool) -> set[FactKey]:
    found: set[FactKey] = set()
    open_, seen = [subject], {subject}
    while open_:
        name = open_.pop()
        if (whole := _part_of(name, world)) is not None:
            nexts: set[str] = {whole}
        elif name in world.places:
            continue
        else:
            found.add(FactKey(AT, name))
            nexts = {value for value in values_of(FactKey(AT, name)) if isinstance(value, str)}
            if (home := stays_at(name, world)) is not None:
                nexts.add(home)
        for carrier in nexts:
            if is_robot(carrier, world):
                if not aboard:
                    continue
                found.add(FactKey(HOLDING, carrier))
            if carrier not in seen:
                seen.add(carrier)
                open_.append(carrier)
    return found
