"""Planners: goals and a world in, a checked plan out. A plug-in derives from `Planner`."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet.planners.base import NoPlan, Planner, PlanningProblem
    from fleet.planners.llm.interpreter import LlmInterpreter
    from fleet.planners.llm.planner import LlmPlanner
    from fleet.planners.symbolic.planner import SymbolicPlanner

__all__ = [
    "LlmInterpreter",
    "LlmPlanner",
    "NoPlan",
    "Planner",
    "PlanningProblem",
    "SymbolicPlanner",
]

_MODULES = {
    "LlmInterpreter": "llm.interpreter",
    "LlmPlanner": "llm.planner",
    "SymbolicPlanner": "symbolic.planner",
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES.get(name, 'base')}"), name)
