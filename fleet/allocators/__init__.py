"""Allocators: actors and robots in, a robot for every actor out, checked on both sides.

A plug-in derives from `Allocator`, or builds one of those here with options of its own.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet.allocators.base import (
        Allocated,
        AllocationProblem,
        Allocator,
        Assignment,
        NotAllocated,
    )
    from fleet.allocators.cost_based import CostBasedAllocator
    from fleet.allocators.llm import LlmAllocator
    from fleet.allocators.makespan import MakespanAllocator
    from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
    from fleet.allocators.round_robin import RoundRobinAllocator
    from fleet.scheduling.plan_shop import AllocationContext

__all__ = [
    "Allocated",
    "AllocationContext",
    "AllocationProblem",
    "Allocator",
    "Assignment",
    "CostBasedAllocator",
    "LlmAllocator",
    "MakespanAllocator",
    "MinMaxLoadAllocator",
    "NotAllocated",
    "RoundRobinAllocator",
    "TieBreak",
]

_MODULES = {
    "CostBasedAllocator": "cost_based",
    "LlmAllocator": "llm",
    "MakespanAllocator": "makespan",
    "MinMaxLoadAllocator": "min_max_load",
    "RoundRobinAllocator": "round_robin",
    "TieBreak": "min_max_load",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES.get(name, 'base')}"), name)
