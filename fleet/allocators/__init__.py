"""Allocators: actors and robots in, a robot for every actor out, checked on both sides.

A plug-in derives from `Allocator`, or builds one of those here with options of its own.
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from fleet.allocators.base import Allocated as Allocated
    from fleet.allocators.base import AllocationProblem as AllocationProblem
    from fleet.allocators.base import Allocator as Allocator
    from fleet.allocators.base import Assignment as Assignment
    from fleet.allocators.base import NotAllocated as NotAllocated
    from fleet.allocators.cost_based import CostBasedAllocator as CostBasedAllocator
    from fleet.allocators.llm import LlmAllocator as LlmAllocator
    from fleet.allocators.makespan import MakespanAllocator as MakespanAllocator
    from fleet.allocators.min_max_load import MinMaxLoadAllocator as MinMaxLoadAllocator
    from fleet.allocators.min_max_load import TieBreak as TieBreak
    from fleet.allocators.round_robin import RoundRobinAllocator as RoundRobinAllocator
    from fleet.scheduling.allocation_context import AllocationContext as AllocationContext
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "base": "Allocated AllocationProblem Allocator Assignment NotAllocated",
            "cost_based": "CostBasedAllocator",
            "llm": "LlmAllocator",
            "makespan": "MakespanAllocator",
            "min_max_load": "MinMaxLoadAllocator TieBreak",
            "round_robin": "RoundRobinAllocator",
            ".scheduling.allocation_context": "AllocationContext",
        },
    )
