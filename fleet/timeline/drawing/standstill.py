"""What holds robots back: emergency stops, pauses and drains, as bars and over the robots."""

from __future__ import annotations

from dataclasses import dataclass

from fleet.timeline.drawing.gantt import Bar, Lanes, Rank
from fleet.timeline.drawing.palette import DRAINED, PAUSED, STOPPED, Rgba
from fleet.timeline.drawing.text import drawable
from fleet.timeline.drawing.world import World
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.stops import Stop, holding

_KINDS = ((HoldKind.DRAIN, "drained", DRAINED), (HoldKind.PAUSE, "paused", PAUSED))


@dataclass(frozen=True)
class _Holder:
    """What a robot is held back by, and how that is drawn."""

    name: str
    label: str
    colour: Rgba
    rank: Rank


class Standstill:
    """Keeps the stops and holds there are; of those that hold a robot a stop is drawn before a
    drain, and that before a pause."""

    def __init__(self, lanes: Lanes, world: World) -> None:
        self._lanes = lanes
        self._world = world
        self._stops: dict[str, Stop] = {}
        self._released: set[tuple[str, str]] = set()
        self._holds: dict[str, Hold] = {}
        self._shown: dict[str, tuple[_Holder, str]] = {}
        """With the key of its bar."""

    def stop(self, name: str, stop: Stop | None, at_s: float) -> None:
        """An emergency stop was given, or is over."""
        if stop is None:
            self._stops.pop(name, None)
            self._released = {pair for pair in self._released if pair[0] != name}
        else:
            self._stops[name] = stop
        self.update(at_s)

    def release(self, stop: str, robot: str, released: bool, at_s: float) -> None:
        """A robot may move again, as far as this stop is concerned; or not any more."""
        (self._released.add if released else self._released.discard)((stop, robot))
        self.update(at_s)

    def hold(self, name: str, hold: Hold | None, at_s: float) -> None:
        """A pause or drain began, or is over."""
        if hold is None:
            self._holds.pop(name, None)
        else:
            self._holds[name] = hold
        self.update(at_s)

    def update(self, at_s: float) -> None:
        """Draw what holds each robot now, where that is another thing than before."""
        for robot, lane in self._lanes.lanes.items():
            now = self._holder(robot)
            before = self._shown.get(robot)
            if before is not None and before[0] == now:
                continue
            if before is not None:
                self._lanes.end(robot, before[1], at_s)
                del self._shown[robot]
            if now is not None:
                bar = Bar(f"{now.name} {at_s:.3f}", now.label, now.colour, at_s, rank=now.rank)
                self._lanes.draw(lane, bar)
                self._shown[robot] = now, bar.key
            if now is not None or before is not None:
                self._world.robot_held(robot, None if now is None else now.label, at_s)

    def _holder(self, robot: str) -> _Holder | None:
        for stop in holding(robot, self._stops, self._released):
            label = _label("stopped", stop.reason)
            return _Holder(f"stop {stop.stop}", label, STOPPED, Rank.STOP)
        for kind, word, colour in _KINDS:
            for name, hold in sorted(self._holds.items()):
                if hold.kind is kind and (hold.of_all or robot in hold.robots):
                    return _Holder(f"hold {name}", _label(word, hold.reason), colour, Rank.HOLD)
        return None


def _label(word: str, reason: str) -> str:
    return drawable(f"{word}: {reason}" if reason else word)
