"""Makespan scheduling: a neutral core, and the allocator that uses it."""

from fleet.allocators.makespan.allocator import MakespanAllocator

__all__ = ["MakespanAllocator"]
