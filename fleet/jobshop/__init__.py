"""A scheduling solver: job shops, flexible job shops, and machines that travel between jobs.

    shop = Shop(operations=(Operation(blocks=(0,), duration_s=(5.0,)),),
                blocks=(Block(operations=(0,), machines=(0, 1)),),
                machines=(Machine(), Machine()))
    schedule = solve(shop, TimeBudget(seconds=1.0))

It knows of operations, blocks and machines, and nothing of robots.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet.jobshop.bounds import lower_bound
    from fleet.jobshop.forward_pass import schedule_of
    from fleet.jobshop.instance import Instance
    from fleet.jobshop.portfolio import solve
    from fleet.jobshop.problem import (
        BadShop,
        Block,
        Machine,
        Operation,
        Position,
        Schedule,
        Shop,
    )
    from fleet.jobshop.rescheduling import Rescheduled, reschedule
    from fleet.jobshop.sequencing import sequences
    from fleet.jobshop.time_budget import StepClock, TimeBudget

__all__ = [
    "BadShop",
    "Block",
    "TimeBudget",
    "Instance",
    "Machine",
    "Operation",
    "Position",
    "Rescheduled",
    "Schedule",
    "Shop",
    "StepClock",
    "lower_bound",
    "reschedule",
    "schedule_of",
    "sequences",
    "solve",
]

_MODULES = {
    "TimeBudget": "time_budget",
    "Instance": "instance",
    "Rescheduled": "rescheduling",
    "StepClock": "time_budget",
    "lower_bound": "bounds",
    "reschedule": "rescheduling",
    "schedule_of": "forward_pass",
    "sequences": "sequencing",
    "solve": "portfolio",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES.get(name, 'problem')}"), name)
