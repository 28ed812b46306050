"""Several things in one trip: two action sequences with a carrier each become one with one carrier.

A carrier drives, and others put things into its basket or take them out; the sequences for two
goals have one each. Joined, what happens at the one carrier is put into the order in which it has
the least way to go: a dial-a-ride problem in which the order within each sequence is given, solved
by dynamic programming (Psaraftis 1980). The carrier's drives are made anew. Whoever loads and
unloads stays free to be anybody.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from heapq import nlargest
from itertools import pairwise
from math import inf
from typing import NamedTuple

from fleet.core.model.durations import only_moves
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, capacity
from fleet.planners.deordering import ActionSequence, Origin
from keyexpr_schema.facts import AT, FactKey

MOST_PAIRS = 256
"""Pairs of trips that are joined to see what that saves: those that promise most."""


class _Stop(NamedTuple):
    """Something that happens in a sequence; `at` says where, if it happens at the carrier.

    Without an action it is the carrier's last arrival. `load` is how many things there are more in
    the basket behind it.
    """

    action: Action | None
    origin: Origin
    at: str | None
    load: int


@dataclass(frozen=True)
class _Trip:
    """What happens in a sequence, and who carries; the carrier's drives are left out."""

    sequence: ActionSequence
    stops: tuple[_Stop, ...]
    carrier: str
    drive: SkillModel

    @property
    def ends(self) -> tuple[str, str]:
        """Where the carrier is first, and last."""
        places = [stop.at for stop in self.stops if stop.at is not None]
        return places[0], places[-1]


class Joined(NamedTuple):
    """Two sequences with one carrier, and how much less it drives than two would [s]."""

    sequence: ActionSequence
    saved_s: float


def joined(first: ActionSequence, second: ActionSequence, world: WorldModel) -> Joined | None:
    """Both with the carrier of one of them; `None` if there is none, or no basket takes it all."""
    one, other = _trip(first, world), _trip(second, world)
    return None if one is None or other is None else _as_one(one, other, world)


class Pair(NamedTuple):
    """Two subgoals by number, and one sequence for both."""

    one: int
    other: int
    made: Joined


class Trips:
    """Finds trips that can be one; what a sequence is as a trip is worked out once."""

    def __init__(self, world: WorldModel) -> None:
        self._world = world
        self._known: dict[int, tuple[ActionSequence, _Trip | None]] = {}

    def pairs(self, options: Sequence[Sequence[ActionSequence]]) -> list[Pair]:
        """Two trips for two of the subgoals that drive less as one, those first that save most.

        Of very many, only those are looked at that promise most by where they begin and end.
        """
        rows = [
            (number, trip)
            for number, alternatives in enumerate(options)
            for sequence in alternatives
            if (trip := self._trip(sequence)) is not None
        ]
        found: list[tuple[float, int, int, int, int, Joined]] = []
        for _, i, j in nlargest(MOST_PAIRS, self._promises(rows)):
            (one, here), (other, there) = rows[i], rows[j]
            made = _as_one(here, there, self._world)
            if made is not None and made.saved_s > 0.0:
                found.append((-made.saved_s, one, other, i, j, made))
        found.sort(key=lambda row: row[:-1])
        return [Pair(one, other, made) for _, one, other, _, _, made in found]

    def _trip(self, sequence: ActionSequence) -> _Trip | None:
        if id(sequence) not in self._known:
            self._known[id(sequence)] = sequence, _trip(sequence, self._world)
        return self._known[id(sequence)][1]

    def _promises(self, rows: Sequence[tuple[int, _Trip]]) -> Iterator[tuple[float, int, int]]:
        """The shorter way, which both have in common at best, without the ways between their ends;
        and which two those are."""
        if not rows:
            return
        ends = [trip.ends for _, trip in rows]
        places = sorted({place for pair in ends for place in pair})
        number = {place: i for i, place in enumerate(places)}
        leg_s = [[_leg_s(a, b, rows[0][1].carrier, self._world) for b in places] for a in places]
        firsts, lasts = ([number[pair[k]] for pair in ends] for k in (0, 1))
        ways_s = [_way_s(trip, self._world) for _, trip in rows]
        for i, (subgoal, _) in enumerate(rows):
            begin_s, end_s, way_s = leg_s[firsts[i]], leg_s[lasts[i]], ways_s[i]
            for j in range(i + 1, len(rows)):
                if rows[j][0] != subgoal:
                    shorter_s = way_s if way_s < ways_s[j] else ways_s[j]
                    yield shorter_s - begin_s[firsts[j]] - end_s[lasts[j]], i, j


def _as_one(one: _Trip, other: _Trip, world: WorldModel) -> Joined | None:
    if one.drive is not other.drive:
        return None
    room, carrier = max((capacity(trip.carrier, world), trip.carrier) for trip in (one, other))
    merged = _shortest(one.stops, _renumbered(other.stops, one.stops), carrier, room, world)
    if merged is None:
        return None
    way_s, stops = merged
    alone_s = sum(_way_s(trip, world) for trip in (one, other))
    rows = list(_with_drives(stops, {one.carrier, other.carrier}, carrier, one.drive))
    sequence = ActionSequence(
        one.sequence.goal,
        tuple(action for action, _ in rows),
        one.sequence.named | other.sequence.named,
        tuple(origin for _, origin in rows),
        frozenset({carrier}),
    )
    return Joined(sequence, alone_s - way_s)


def _trip(sequence: ActionSequence, world: WorldModel) -> _Trip | None:
    """The sequence as a trip, if there is one robot in it that only drives and has a basket."""
    helpers = {r for action in sequence.actions for r in action.participants[1:]}
    drivers = {a.actor for a in sequence.actions} - {
        a.actor for a in sequence.actions if not only_moves(a.skill)
    }
    carriers = [r for r in sorted(helpers & drivers) if world.capability(r, "basket")]
    if len(carriers) != 1 or carriers[0] in sequence.named:
        return None
    (carrier,) = carriers
    drives = [a for a in sequence.actions if a.actor == carrier]
    drive = drives[0].skill
    if any(a.skill is not drive for a in drives) or len(drive.parameters) != 2:
        return None
    stops: list[_Stop] = []
    place = FactKey(AT, carrier)
    last: tuple[str, Origin] | None = None
    for action, origin in sequence.with_origins:
        if action.actor == carrier:
            last = str(action.args[str(drive.travel_to)]), origin
        elif carrier in action.participants:
            at = next((str(value) for key, value in action.before if key == place), None)
            stops.append(_Stop(action, origin, at, _loads(action, carrier)))
            last = None
        else:
            stops.append(_Stop(action, origin, None, 0))
    if last is not None:
        stops.append(_Stop(None, last[1], last[0], 0))
    if all(stop.at is None for stop in stops):
        return None
    return _Trip(sequence, tuple(stops), carrier, drive)


def _loads(action: Action, carrier: str) -> int:
    """How many things more are in the carrier's basket behind the action."""
    into = sum(key.relation == AT and value == carrier for key, value in action.after)
    out = sum(
        key.relation == AT and value == carrier and any(k == key for k, _ in action.after)
        for key, value in action.before
    )
    return into - out


def _renumbered(stops: Sequence[_Stop], others: Sequence[_Stop]) -> tuple[_Stop, ...]:
    """With numbers of parts behind those of `others`."""
    first = 1 + max(stop.origin.part for stop in others)
    return tuple(
        stop._replace(origin=Origin(stop.origin.goal, first + stop.origin.part)) for stop in stops
    )


def _shortest(
    one: Sequence[_Stop], other: Sequence[_Stop], carrier: str, room: float, world: WorldModel
) -> tuple[float, list[_Stop]] | None:
    """The order of both with the least way, s, and never more than `room` things in the basket.

    Where a trip ends with an arrival, the carrier stays there: nothing follows anywhere else.
    """
    rows = one, other
    stay = [row[-1].at if row[-1].action is None else None for row in rows]
    loads = [_running(row) for row in rows]

    @cache
    def rest(i: int, j: int, here: str | None) -> tuple[float, tuple[int, ...]]:
        """The least way for what is left, and from which of both the stops come."""
        if (i, j) == (len(one), len(other)):
            return 0.0, ()
        best: tuple[float, tuple[int, ...]] = (inf, ())
        for which, done in ((0, i), (1, j)):
            if done == len(rows[which]):
                continue
            stop, mine = rows[which][done], (i, j)
            behind = (i + 1, j) if which == 0 else (i, j + 1)
            if loads[0][behind[0]] + loads[1][behind[1]] > room:
                continue
            if stop.at is not None and any(
                stay[k] not in (None, stop.at) and mine[k] == len(rows[k]) for k in (0, 1)
            ):
                continue
            there = stop.at or here
            more_s, order = rest(*behind, there)
            way_s = more_s + (_leg_s(here, stop.at, carrier, world) if stop.at else 0.0)
            if way_s < best[0]:
                best = way_s, (which, *order)
        return best

    way_s, order = rest(0, 0, None)
    if way_s == inf:
        return None
    left = [iter(one), iter(other)]
    return way_s, [next(left[which]) for which in order]


def _running(stops: Sequence[_Stop]) -> list[int]:
    """What is in the basket before each stop, and in the end."""
    sums = [0]
    for stop in stops:
        sums.append(sums[-1] + stop.load)
    return sums


def _leg_s(origin: str | None, target: str, carrier: str, world: WorldModel) -> float:
    if origin == target or origin is None:
        return 0.0
    return world.travel_s(carrier, origin, target)


def _way_s(trip: _Trip, world: WorldModel) -> float:
    places = [stop.at for stop in trip.stops if stop.at is not None]
    return sum(_leg_s(a, b, trip.carrier, world) for a, b in pairwise(places))


def _with_drives(
    stops: Sequence[_Stop], carriers: set[str], carrier: str, drive: SkillModel
) -> Iterator[tuple[Action, Origin]]:
    """The actions with `carrier` in place of all `carriers`, and its drives to where they are."""
    here: str | None = None
    for stop in stops:
        if stop.at is not None and stop.at != here:
            here = stop.at
            args = {drive.actor_parameter: carrier, str(drive.travel_to): here}
            yield drive.ground(args), stop.origin
        if stop.action is not None:
            args = {
                name: carrier if value in carriers else value
                for name, value in stop.action.args.items()
            }
            yield stop.action.skill.ground(args), stop.origin
