"""Language models: asked within a budget, in correction rounds, for structured output."""

from fleet.errors import BadLlmConfig
from fleet.llm.budget import Budget
from fleet.llm.client import ModelClient
from fleet.llm.configuration import LlmConfig, load_llm_config
from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.structured_output import StructuredAnswer, read_answer, schema_of

__all__ = [
    "BadLlmConfig",
    "Budget",
    "GivenUp",
    "LanguageModel",
    "LlmConfig",
    "ModelClient",
    "Rejected",
    "StructuredAnswer",
    "load_llm_config",
    "read_answer",
    "schema_of",
]
