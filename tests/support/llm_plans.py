"""Plans as a model would write them, and the language-model planner asked for one."""

from __future__ import annotations

from typing import Any

from fleet.allocators.base import Allocated
from fleet.allocators.min_max_load import MinMaxLoadAllocator, TieBreak
from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.world import WorldModel
from fleet.llm.client import ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners.base import PlanningProblem
from fleet.planners.llm.planner import LlmPlanner
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan
from tests.support.household import bring, checked, home
from tests.support.llm_server import LlmServer
from tests.support.polling import DEADLINE_S

GOALS = (bring(1, "hallway"), bring(2, "living_room"))


def config(server: LlmServer, **fields: Any) -> LlmConfig:
    return LlmConfig(
        **{
            "model": "openai/scripted",
            "api_base": server.api_base,
            "timeout_s": DEADLINE_S,
            "retry_wait_s": 0.01,
            **fields,
        }
    )


def task(name: str, skill: str, after: list[str], goal: str, **args: str) -> dict[str, Any]:
    return {"task": name, "skill": skill, "args": args, "after": after, "goal": goal}


def carry(number: int, place: str, actor: str, prefix: str = "") -> list[dict[str, Any]]:
    """Four tasks that carry a cup from the kitchen, as a model would write them."""
    names = [f"{prefix}{step}{number}" for step in ("go", "pick", "bring", "put")]
    goal, thing = f"g{number}", f"cup_{number}"
    return [
        task(names[0], "navigate", [], goal, robot=actor, to="kitchen"),
        task(names[1], "pick", [names[0]], goal, robot=actor, object=thing, place="kitchen"),
        task(names[2], "navigate", [names[1]], goal, robot=actor, to=place),
        task(names[3], "place", [names[2]], goal, robot=actor, object=thing, place=place),
    ]


def graph(*tasks: dict[str, Any], pins: list[dict[str, str]] | None = None) -> dict[str, Any]:
    return {"tasks": list(tasks), "pins": pins or []}


def flat(*tasks: dict[str, Any]) -> dict[str, Any]:
    rows = [{name: row[name] for name in ("skill", "args", "goal")} for row in tasks]
    return {"tasks": rows, "pins": []}


GOOD = graph(*carry(1, "hallway", "?a1"), *carry(2, "living_room", "?a2"))
WRONG = graph(*carry(1, "hallway", "?a1"), *carry(2, "hallway", "?a2"))


def solve(
    server: LlmServer,
    client: ModelClient,
    goals: tuple[Goal, ...] = GOALS,
    world: WorldModel | None = None,
    strategy: str = "big-dag",
    first_task: int = 1,
    **fields: Any,
) -> Plan:
    world = world or home()
    planner = LlmPlanner(LanguageModel(config(server, **fields), client), SymbolicPlanner())
    problem = PlanningProblem("p", goals, world, strategy=strategy, first_task=first_task)
    made = planner.plan(problem)
    assert isinstance(made, CheckedPlan), made
    assert isinstance(
        MinMaxLoadAllocator(TieBreak.TRAVEL).allocate(checked(made.plan, world)), Allocated
    )
    return made.plan


def fell_back(plan: Plan, words: str) -> None:
    assert plan.made_by == "symbolic"
    assert plan.making.planner == "symbolic"
    assert plan.making.fallback is not None
    assert words in plan.making.fallback, plan.making.fallback
    assert plan.tasks
