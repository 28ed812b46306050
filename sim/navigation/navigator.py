"""`Navigator`: brings every robot where it shall go, and keeps them apart."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.robots import PoseMRad
from sim.errors import NoPath, NoStance
from sim.files.solids import Solid
from sim.files.world_schema import LARGEST_RADIUS_M, WorldFile
from sim.navigation import own_ways, stances
from sim.navigation.distance_field import DistanceField
from sim.navigation.errand import Errand, patience_s
from sim.navigation.floor import Floors
from sim.navigation.lanes import with_lanes
from sim.navigation.spots import Dock, Spots
from sim.navigation.steering import Leg, braking_m, passed, steer
from sim.navigation.traffic import Traffic
from sim.navigation.traveller import Traveller

LINGER_S = 10.0
"""How long a robot that reached a stance is left alone there, since it came to do something."""

LOOKAHEAD_NODES, MARGIN_M = 3, 0.15
"""So many nodes at the most are promised ahead of a robot, and one more when no more is left than
its braking distance and this margin: what it need not have yet, others can use."""


class Navigator:
    """Routes, traffic and legs for all robots of one world. Metres and radians, world frame.

    `tick` is called once each control period with where every robot is. It answers with a `Leg` for
    every robot that is not pinned, those with nowhere to go included, since they may have to make
    way. A robot whose controller keeps within 5 cm of its legs touches nobody.
    """

    def __init__(self, world: WorldFile, fixed: Sequence[Solid] = ()) -> None:
        """`fixed` stands on the floor besides what the world file says: robots that never drive."""
        self._world = world
        self._spots = Spots(world, fixed)
        self._lattice = self._spots.lattice
        self._traffic = Traffic(self._lattice, self._spots.retreat, self._spots.bottlenecks)
        self._floors = Floors(self._lattice)
        self._models: dict[str, str] = {}
        self._robots: dict[str, Traveller] = {}
        self._speeds: dict[str, float] = {}
        self._poses: dict[str, PoseMRad] = {}
        self._tasks: dict[str, Errand] = {}
        self._failed: dict[str, str] = {}
        self._pinned: set[str] = set()
        self._lingers: dict[str, float] = {}
        self._yaws: dict[str, float] = {}
        self._time_s = self._got_on_s = 0.0

    def add_robot(
        self,
        robot: str,
        pose_m_rad: PoseMRad,
        radius_m: float,
        speed_m_s: float = 0.6,
        model: str = "",
    ) -> None:
        """A robot that stands at `pose_m_rad`, with the radius of its footprint and its top speed.
        Closures may be for robots of its `model`.

        Raises:
            NoPath: it is too large, or there is no way from there to where robots drive.
        """
        if radius_m > LARGEST_RADIUS_M:
            raise NoPath(
                f"{robot} has a radius of {radius_m} m; "
                f"the largest that traffic is laid out for is {LARGEST_RADIUS_M} m"
            )
        here = (float(pose_m_rad[0]), float(pose_m_rad[1]))
        docks = [
            self._spots.dock(here, node, radius_m, pose_m_rad[2])
            for node in self._spots.ways_in(here, radius_m)
        ]
        if not docks:
            raise NoPath(f"{robot} at ({here[0]:.2f}, {here[1]:.2f}) is hemmed in: no way out")
        dock = own_ways.way_out(docks, radius_m, self._robots, self._lattice)
        self._models[robot] = model
        if self._floors.lanes is not with_lanes(self._lattice, len(self._models)):
            self.close(self._floors.closures)
        floor = self._floors.of(model)
        horizon_m = braking_m(speed_m_s) + MARGIN_M
        traveller = Traveller(
            robot, radius_m, floor, track=[dock.node], parked=dock, horizon_m=horizon_m
        )
        traveller.recount()
        self._robots[robot] = traveller
        self._speeds[robot], self._poses[robot] = speed_m_s, pose_m_rad

    def close(self, closures: Sequence[Closure]) -> None:
        """Let no robot enter what these close; robots that are on their way go around, or fail.

        They take the place of those of before.
        """
        self._floors = Floors(self._lattice, closures, len(self._models))
        for name, traveller in self._robots.items():
            traveller.floor = self._floors.of(self._models[name])
            task = self._tasks.get(name)
            if task is not None and traveller.goal is not None and traveller.parked is None:
                traveller.goal = traveller.dock = None  # chosen anew
                self._yaws.pop(name, None)
        self._traffic.close(self._floors.narrow)

    def go_to_place(self, robot: str, place: str) -> None:
        """Send `robot` to a free spot in `place`, clear of doors and of others' spots.

        A robot that already is there, in nobody's way, stays. If every spot is taken, it waits for
        one for a minute, then its leg has failed.

        Raises:
            NoStance: there is nowhere to wait in that place.
            NoPath: there is no way to it, whatever the traffic.
        """
        self.cancel(robot)
        spots = self._spots.waiting[place]
        if not spots:
            raise NoStance(f"there is no room to wait in {place}")
        part = self._lattice.parts[self._robots[robot].frontier]
        if not any(self._lattice.parts[node] == part for node in spots):
            raise NoPath(f"there is no way to {place} from where {robot} stands")
        self._tasks[robot] = Errand(place, self._time_s, place=place)

    def look_out_for(self, obstacles: Callable[[], Sequence[Solid]]) -> None:
        """Keep stances, and the ways to them, clear of what stands there for the time being."""
        self._spots.obstacles = obstacles

    def reserve(self, robot: str, points_m: Sequence[tuple[float, float]]) -> bool:
        """Keep others away from the line through `points_m`, which `robot` will drive by itself.

        Only for a robot at a stance. False, and nothing is kept, while others are there; until it
        is true, or the robot is sent elsewhere, they are asked to leave.
        """
        return own_ways.reserve(self._robots, robot, self._lattice, points_m)

    def settle(self, robot: str) -> None:
        """Note that `robot` has driven by itself to where it stands now: that is its stance."""
        own_ways.settle(self._robots, robot, self._spots, self._poses[robot])

    def approach(
        self,
        robot: str,
        point_m: tuple[float, float, float],
        reach_m: tuple[float, float],
        heading_rad: float | None = None,
        in_vain: Sequence[tuple[float, float]] = (),
        fits: Callable[[PoseMRad], bool] | None = None,
    ) -> None:
        """Let `robot` stand facing `point_m`, its centre between `reach_m` (min, max) away from it,
        and itself turned to `heading_rad` if that is given.

        It stands elsewhere than it has been `in_vain`, and where the pose `fits`, if there is such
        a stance.

        If all such stances are taken, it waits for one for a minute, then its leg has failed.

        Raises:
            NoStance: there is no free floor at that distance.
            NoPath: there is, and no way to it.
        """
        self.cancel(robot)
        traveller = self._robots[robot]
        what = f"({point_m[0]:.2f}, {point_m[1]:.2f})"
        part = self._lattice.parts[traveller.frontier]
        failed = f"{robot} does not get to {what}"
        reach = (point_m, traveller.radius_m, reach_m, heading_rad)
        docks = self._spots.docks(*reach, part, in_vain, failed)
        self._tasks[robot] = Errand(what, self._time_s, docks=docks, fits=fits)

    def reaches(
        self, robot: str, point_m: tuple[float, float, float], reach_m: tuple[float, float]
    ) -> bool:
        """Whether there is a stance for `approach`, whoever stands there now."""
        return bool(self._spots.stances(point_m, self._robots[robot].radius_m, reach_m))

    def cancel(self, robot: str) -> None:
        """Forget where `robot` was going; it comes to rest within a step or two."""
        traveller = self._robots[robot]
        self._failed.pop(robot, None)
        self._yaws.pop(robot, None)
        traveller.wanted = frozenset()
        if self._tasks.pop(robot, None) is None:
            return
        traveller.goal = traveller.dock = None
        traveller.give_up(self._poses[robot], self._lattice.points)
        if traveller.parked is not None and not traveller.leaving:
            x, y, yaw = self._poses[robot]
            parked = traveller.parked
            traveller.parked = Dock(parked.node, (x, y), yaw, parked.owned)
        traveller.recount()

    def pin(self, robot: str, pinned: bool) -> None:
        """Say that `robot` must not be moved (its arm is at work), or that it may be again."""
        if pinned:
            self._pinned.add(robot)
        else:
            self._pinned.discard(robot)

    def tick(self, time_s: float, poses: dict[str, PoseMRad]) -> dict[str, Leg]:
        """Where each robot that is not pinned shall drive now, given where all of them are."""
        self._time_s = time_s
        self._poses.update(poses)
        for name, traveller in self._robots.items():
            self._release(traveller)
            traveller.static = name in self._pinned or (
                traveller.parked is not None
                and not traveller.leaving
                and traveller.goal is None
                and (
                    name in self._yaws  # on its way into a stance
                    if name in self._tasks
                    else time_s < self._lingers.get(name, -math.inf)
                )
            )
        static = [traveller for traveller in self._robots.values() if traveller.static]
        blocked = frozenset().union(*(traveller.claims for traveller in static))
        for name in list(self._tasks):
            self._resolve(name, blocked)
        self._traffic.decide(time_s, self._robots, LOOKAHEAD_NODES)
        return {name: self._leg(name) for name in self._robots if name not in self._pinned}

    def reserved(self, robot: str) -> frozenset[int]:
        """The nodes that `robot` has to itself; no two robots share one."""
        return self._robots[robot].claims

    def _release(self, traveller: Traveller) -> None:
        x, y, _ = self._poses[traveller.name]
        points = self._lattice.points
        changed = False
        if traveller.parked is not None and traveller.leaving:
            node = points[traveller.track[0]]
            if math.dist((x, y), node) <= 0.06:
                traveller.parked, traveller.leaving = None, False
                self._lingers.pop(traveller.name, None)
                changed = True
        while len(traveller.track) > 1 and passed((x, y), [points[n] for n in traveller.track[:3]]):
            del traveller.track[0], traveller.corners[0]
            changed = True
        if changed:
            traveller.recount()
        ahead = [points[node] for node in traveller.track[1:]]
        traveller.ahead_m = sum(math.dist(a, b) for a, b in pairwise([(x, y), *ahead]))

    def _resolve(self, name: str, blocked: frozenset[int]) -> None:
        """Choose the spot or stance to go to, or another one if somebody stands there now.

        `blocked` are the nodes of robots that stay where they are.
        """
        task, traveller = self._tasks[name], self._robots[name]
        traveller.since_s = task.since_s
        if name in self._failed or name in self._pinned:
            return
        x, y, _ = self._poses[name]
        if task.moved_s is None or math.dist(task.moved_at, (x, y)) > 0.1:
            task.moved_s, task.moved_at = self._time_s, (x, y)
            self._got_on_s = self._time_s
        if traveller.goal is not None:
            owned = traveller.dock.owned if traveller.dock else frozenset()
            if traveller.goal not in blocked and blocked.isdisjoint(owned):
                self._give_up_late(name, task)
                return
            traveller.goal = traveller.dock = None
            self._yaws.pop(name, None)
        elif traveller.parked is not None and not traveller.leaving and name in self._yaws:
            return  # on its way into the stance
        if (closed := task.closed_to(traveller, self._spots.waiting)) is not None:
            self.cancel(name)
            self._failed[name] = f"no way to {task.what}: {closed}"
            return
        others = [other for other in self._robots.values() if other is not traveller]
        taken = set(blocked)
        for other in others:
            if other.goal is not None:
                taken.add(other.goal)
            if other.dock is not None:
                taken |= other.dock.owned
        around = traveller.floor.field_from(traveller.frontier, blocked - traveller.claims)
        if task.place is not None:
            self._choose_spot(name, task, around, frozenset(taken), others)
        else:
            self._choose_dock(name, task, around, frozenset(taken))
        if traveller.goal is None and name in self._tasks:
            self._give_up_late(name, task)

    def _choose_spot(
        self,
        name: str,
        task: Errand,
        around: DistanceField,
        taken: frozenset[int],
        others: list[Traveller],
    ) -> None:
        assert task.place is not None
        traveller = self._robots[name]
        here = traveller.frontier
        x, y, _ = self._poses[name]
        if (
            traveller.parked is not None
            and not traveller.leaving
            and name not in self._lingers
            and task.place in self._world.places_around(self._world.place_at(x, y))
            and here in self._spots.waiting[task.place]
        ):
            self._arrive(name)
            return
        idle = frozenset().union(*(other.claims for other in others if other.goal is None))
        traveller.goal = self._spots.waiting_spot(task.place, around, taken, idle)

    def _choose_dock(
        self, name: str, task: Errand, around: DistanceField, taken: frozenset[int]
    ) -> None:
        traveller = self._robots[name]
        if (dock := next(filter(task.suits, task.at(traveller)), None)) is not None:
            # It stands there already: turning on the spot needs nobody's room.
            assert traveller.parked is not None
            traveller.parked = replace(traveller.parked, yaw_rad=dock.yaw_rad)
            self._yaws[name] = dock.yaw_rad
            self._lingers[name] = self._time_s + LINGER_S
            return
        others = [other for other in self._robots.values() if other is not traveller]
        dock = stances.choose(task, traveller, others, around, taken, self._spots)
        if dock is not None:
            traveller.goal, traveller.dock = dock.node, dock
            self._yaws[name] = dock.yaw_rad

    def _give_up_late(self, name: str, task: Errand) -> None:
        patience = patience_s(self._got_on_s, self._time_s)
        if task.moved_s is None or self._time_s - task.moved_s < patience:
            return
        traveller = self._robots[name]
        others = [other for other in self._robots.values() if other is not traveller]
        x, y, _ = self._poses[name]
        near = sorted(
            (other.name for other in others if other.static or traveller.goal is None),
            key=lambda other: math.dist(self._poses[other][:2], (x, y)),
        )[:3]
        reason = f"no way to {task.what}"
        if traveller.goal is None and task.place is not None:
            taken = frozenset().union(*(other.claims | {other.goal} for other in others))
            if taken.issuperset(self._spots.waiting[task.place]):
                reason = f"no free spot in {task.place}"
        if near:
            reason += f": {', '.join(near)} {'stands' if len(near) == 1 else 'stand'} in the way"
        self.cancel(name)
        self._failed[name] = reason

    def _arrive(self, name: str) -> None:
        del self._tasks[name]
        self._robots[name].goal = None
        self._got_on_s = self._time_s

    def _leg(self, name: str) -> Leg:
        traveller = self._robots[name]
        points = self._lattice.points
        ahead = [points[node] for node in traveller.track]
        yaw = self._yaws.get(name)
        parked = traveller.parked
        if parked is not None:
            ahead = [ahead[0] if traveller.leaving else parked.point_m]
        at_goal = parked is not None and not traveller.leaving and traveller.goal is None
        leg = steer(
            self._poses[name],
            ahead,
            on_line=parked is None,
            yaw_rad=yaw if at_goal else None,
            speed_m_s=self._speeds[name],
            failed=self._failed.get(name),
        )
        if name in self._tasks and leg.arrived:
            if at_goal and yaw is not None:
                self._lingers[name] = self._time_s + LINGER_S
                self._arrive(name)
            elif traveller.dock is None and traveller.goal == traveller.frontier and parked is None:
                self._arrive(name)
        arrived = name not in self._tasks and leg.failed is None
        return leg if leg.arrived == arrived else leg._replace(arrived=arrived)
