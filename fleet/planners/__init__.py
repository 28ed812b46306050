"""Planners: goals and a world in, a checked plan out. A plug-in derives from `Planner`."""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from fleet.core.checker.plan_checker import CheckedPlan as CheckedPlan
    from fleet.planners.base import NoPlan as NoPlan
    from fleet.planners.base import Planner as Planner
    from fleet.planners.base import PlanningProblem as PlanningProblem
    from fleet.planners.deordering import ActionSequence as ActionSequence
    from fleet.planners.deordering import deordered as deordered
    from fleet.planners.llm.paraphraser import LlmParaphraser as LlmParaphraser
    from fleet.planners.llm.planner import LlmPlanner as LlmPlanner
    from fleet.planners.programs.base import ProgramTask as ProgramTask
    from fleet.planners.programs.base import ProgramWriter as ProgramWriter
    from fleet.planners.symbolic.planner import SymbolicPlanner as SymbolicPlanner
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "base": "NoPlan Planner PlanningProblem",
            "deordering": "ActionSequence deordered",
            "llm.paraphraser": "LlmParaphraser",
            "llm.planner": "LlmPlanner",
            "programs.base": "ProgramTask ProgramWriter",
            "symbolic.planner": "SymbolicPlanner",
            ".core.checker.plan_checker": "CheckedPlan",
        },
    )
