"""Planning by language model: configuration, planner, and interpreter of goal sentences."""

from fleet.planners.llm.caller import ModelCaller
from fleet.planners.llm.config import LlmConfig, load_llm_config
from fleet.planners.llm.errors import BadLlmConfig
from fleet.planners.llm.interpreter import LlmInterpreter
from fleet.planners.llm.planner import LlmPlanner

__all__ = [
    "BadLlmConfig",
    "LlmConfig",
    "LlmInterpreter",
    "LlmPlanner",
    "ModelCaller",
    "load_llm_config",
]
