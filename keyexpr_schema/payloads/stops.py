"""Emergency stops: latched, and obeyed by whoever drives a robot, without the planner."""

from __future__ import annotations

from collections.abc import Container, Mapping

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class StopAddress(Address, frozen=True):
    """One emergency stop."""

    stop: str


class StopReleaseAddress(Address, frozen=True):
    """One robot that an emergency stop no longer holds."""

    stop: str
    robot: str


class Stop(Payload, frozen=True, kw_only=True):
    """Nothing that it names may move while its key is there and does not release the robot.

    `robots` empty: every robot, also those that come later. Each stop has a name of its own, and
    what resumes deletes the ones it has seen: so a stop that somebody gives at the same moment
    still stands.
    """

    stop: Id
    robots: tuple[Id, ...] = ()
    by: Author = ""
    reason: str = ""
    wall_time_s: float = 0.0
    """When it was given, Unix time [s]."""

    def names(self, robot: str) -> bool:
        """Whether it was given for this robot, which may have been released since."""
        return not self.robots or robot in self.robots

    def holds(self, robot: str, released: Container[tuple[str, str]]) -> bool:
        """Whether it holds this robot; `released` are pairs of stop and robot."""
        return self.names(robot) and (self.stop, robot) not in released

    def __str__(self) -> str:
        whom = f" by {self.by}" if self.by else ""
        why = f" ({self.reason})" if self.reason else ""
        return f"emergency stop {self.stop}{whom}{why}"


class StopRelease(Payload, frozen=True, kw_only=True):
    """This robot may move again, as far as this stop is concerned."""

    stop: Id
    robot: Id
    by: Author = ""
    wall_time_s: float = 0.0
    """Unix time [s]."""


def holding(
    robot: str, stops: Mapping[str, Stop], released: Container[tuple[str, str]]
) -> tuple[Stop, ...]:
    """The stops that hold a robot still, by name; `released` are pairs of stop and robot."""
    return tuple(stops[name] for name in sorted(stops) if stops[name].holds(robot, released))
