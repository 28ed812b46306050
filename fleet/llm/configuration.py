"""Configuration of the language model: which one, how it is asked, and what it may cost."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import msgspec

from fleet.errors import BadLlmConfig
from fleet.planner_file import planner_section
from keyexpr_schema.config_files import config_file

Seconds = Annotated[float, msgspec.Meta(gt=0)]
Count = Annotated[int, msgspec.Meta(ge=0)]
Positive = Annotated[int, msgspec.Meta(ge=1)]
Usd = Annotated[float, msgspec.Meta(ge=0)]


class Structured(str, Enum):
    """How the form of the answer is asked for.

    `auto` sends the JSON schema, and leaves it out for a server that refuses it.
    """

    AUTO = "auto"
    SCHEMA = "schema"
    PLAIN = "plain"


class LlmConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The `llm` section of a planner configuration; without a `model` no model is ever asked.

    `model` is a name that LiteLLM knows (`openai/gpt-4o-mini`, `anthropic/…`, `ollama_chat/…`), or
    `openai/NAME` with the `api_base` of any OpenAI-compatible server. The API key is read from the
    environment variable `api_key_env`; with an `api_base` and no `api_key_env` none is sent.
    """

    model: str | None = None
    api_base: str | None = None
    api_key_env: str | None = None
    temperature: Annotated[float, msgspec.Meta(ge=0, le=2)] | None = 0.0
    """`null` sends none, for models that refuse it."""
    max_tokens: Positive = 4000
    """Of one answer."""
    timeout_s: Seconds = 60.0
    """For one answer, from the request to its last byte."""
    retries: Count = 2
    """More tries of a call after a rate limit or an unavailable server."""
    retry_wait_s: Seconds = 1.0
    """Before the first retry, doubled for each further one, unless the server says how long."""
    max_repairs: Count = 3
    """Correction rounds: after a rejected answer the model hears what was wrong with it."""
    max_tokens_per_plan: Positive = 100_000
    """In and out, over all rounds of a plan."""
    max_usd_per_plan: Usd | None = None
    max_wall_s: Seconds = 180.0
    """For all rounds of a plan."""
    usd_per_million_tokens_in: Usd | None = None
    """Prices for models whose price LiteLLM does not know."""
    usd_per_million_tokens_out: Usd | None = None
    max_tasks: Positive = 200
    """A longer plan is refused."""
    structured: Structured = Structured.AUTO
    prompts: str = "v1"
    rules_dir: str | None = None
    """Text files here stand in for prompts of the same name; relative to the configuration file."""
    options: dict[str, Any] = {}
    """More arguments for the LiteLLM call, such as `seed`."""

    def __post_init__(self) -> None:
        """Refuse what only fails once the model is asked.

        Raises:
            ValueError: with the reason.
        """
        if self.model is not None and not self.model.strip():
            raise ValueError("`model` is empty: name one, or write null for none")
        if (self.usd_per_million_tokens_in is None) != (self.usd_per_million_tokens_out is None):
            raise ValueError("prices come in pairs: give `usd_per_million_tokens_in` and `…_out`")
        if self.api_base is not None and not self.api_base.startswith(("http://", "https://")):
            raise ValueError("`api_base` must start with http:// or https://")
        if taken := sorted(RESERVED_OPTIONS & self.options.keys()):
            raise ValueError(f"`options` must not name {taken[0]}, which RobotFleet sets itself")

    @property
    def not_configured(self) -> str | None:
        """What to do if no model is configured, or `None` if one is."""
        if self.model is not None:
            return None
        return (
            "no language model is configured: give `model` under `llm` in configs/planner.yaml "
            "(docs/llm-planning.md shows how), or plan with the symbolic planner"
        )


RESERVED_OPTIONS = frozenset(
    {
        "model",
        "messages",
        "api_base",
        "base_url",
        "api_key",
        "temperature",
        "max_tokens",
        "timeout",
        "response_format",
        "stream",
        "n",
        "tools",
        "functions",
        "max_retries",
        "num_retries",
    }
)


def load_llm_config(path: Path | None = None) -> LlmConfig:
    """The `llm` section of the file at `path`; else of `planner.yaml` (see `config_file`).

    Raises:
        BadLlmConfig: the file cannot be read, or a field is not right.
    """
    path = path or config_file(".", "planner")
    config = planner_section(path, "llm", LlmConfig, BadLlmConfig)
    if config.rules_dir is None:
        return config
    return msgspec.structs.replace(config, rules_dir=str(path.parent / config.rules_dir))
