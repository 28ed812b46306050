"""Planning by language model: configuration, planner, and interpreter of goal sentences."""

from fleet.llm.client import ModelCaller
from fleet.llm.configuration import LlmConfig, load_llm_config
from fleet.llm.errors import BadLlmConfig
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
