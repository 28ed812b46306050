"""Payloads about how long robots really take."""

from __future__ import annotations

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class DurationsAddress(Address, frozen=True):
    """One type of robot."""

    model: str


class Estimate(Payload, frozen=True, kw_only=True):
    """A quantity as it was observed: its weighted mean and standard deviation.

    `count` is the number of attempts it was learned from. `weight` says how firmly the mean stands
    against the next observation, what was assumed before the first one included.
    """

    mean: float
    sd: float = 0.0
    count: int = 0
    weight: float = 0.0


class Durations(Payload, frozen=True, kw_only=True):
    """What the planner learned from the reports of one type of robot (`model`).

    `skills` has each skill's duration without the way to it [s]. `pace` is how much longer a way
    takes than its length and the robot's top speed say (1: just as long).
    """

    model: Id
    pace: Estimate | None = None
    skills: dict[str, Estimate] = {}
    time_s: float = 0.0
