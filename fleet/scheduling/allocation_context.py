"""The allocation context: who is busy, what matters, who did what until now."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from fleet.jobshop.time_budget import TimeBudget


@dataclass(frozen=True)
class AllocationContext:
    """What counts in an allocation besides plan and world.

    `ready_s` says from when on a robot is free [s from now]; `priority` of a goal decides between
    equal makespans (each step up counts twice); `due_s` says when a goal should be done
    [s from now]. `previous_allocation` has the robots of actors in the plan that this is the rest
    of, and `actor_order` the order in which they were to begin: few actors should change hands.
    Actors that are `under_way` go on at once. By the end of `limit` there has to be an answer.
    """

    ready_s: Mapping[str, float] = field(default_factory=dict)
    priority: Mapping[str, int] = field(default_factory=dict)
    due_s: Mapping[str, float] = field(default_factory=dict)
    previous_allocation: Mapping[str, str] = field(default_factory=dict)
    actor_order: tuple[str, ...] = ()
    under_way: frozenset[str] = frozenset()
    limit: TimeBudget = field(default_factory=lambda: TimeBudget(inf), compare=False)
