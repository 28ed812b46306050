"""A scheduling solver: job shops, flexible job shops, and machines that travel between jobs.

    shop = Shop(operations=(Operation(blocks=(0,), duration_s=(5.0,)),),
                blocks=(Block(operations=(0,), machines=(0, 1)),),
                machines=(Machine(), Machine()))
    schedule = solve(shop, TimeBudget(seconds=1.0))

It knows of operations, blocks and machines, and nothing of robots.
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from fleet.jobshop.bounds import lower_bound as lower_bound
    from fleet.jobshop.forward_pass import schedule_of as schedule_of
    from fleet.jobshop.portfolio import solve as solve
    from fleet.jobshop.preprocessing import Instance as Instance
    from fleet.jobshop.problem import BadShop as BadShop
    from fleet.jobshop.problem import Block as Block
    from fleet.jobshop.problem import Machine as Machine
    from fleet.jobshop.problem import Operation as Operation
    from fleet.jobshop.problem import Position as Position
    from fleet.jobshop.problem import Schedule as Schedule
    from fleet.jobshop.problem import Shop as Shop
    from fleet.jobshop.rescheduling import Rescheduled as Rescheduled
    from fleet.jobshop.rescheduling import reschedule as reschedule
    from fleet.jobshop.sequencing import sequences as sequences
    from fleet.jobshop.time_budget import StepClock as StepClock
    from fleet.jobshop.time_budget import TimeBudget as TimeBudget
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "bounds": "lower_bound",
            "forward_pass": "schedule_of",
            "portfolio": "solve",
            "preprocessing": "Instance",
            "problem": "BadShop Block Machine Operation Position Schedule Shop",
            "rescheduling": "Rescheduled reschedule",
            "sequencing": "sequences",
            "time_budget": "StepClock TimeBudget",
        },
    )
