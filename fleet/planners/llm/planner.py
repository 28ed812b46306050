"""The language-model planner: propose, check, repair, and otherwise the symbolic planner."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.llm.client import ModelCaller
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import Conversation, GivenUp, Ledger, Rejected
from fleet.llm.prompts import load_prompts
from fleet.planners.base import NoPlan, Planner, PlanningProblem
from fleet.planners.llm.answers import GraphAnswer, ListAnswer, plan_schema, read_answer
from fleet.planners.llm.draft import Draft, conditions_of, draft_of, merged, plan_of, world_after
from fleet.planners.llm.interpreter import LlmInterpreter
from fleet.planners.llm.prompt_text import problem_text, skills_text, useful_skills
from fleet.planners.llm.verify import why_not, without_useless
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Making, Plan

log = logging.getLogger(__name__)

MONOLITHIC = "monolithic"
PER_GOAL = "per-goal"
BIG_DAG = "big-dag"


class LlmPlanner(Planner):
    """Plans by a language model, within a budget; `fallback` takes over where that fails.

    Strategies: `big-dag` asks for one graph for all goals, `per-goal` for one graph for each goal,
    `monolithic` for one flat list, whose order is loosened to what causes call for.

    Blocks while it asks: up to `max_wall_s` of the configuration, and the first time for the start
    of LiteLLM as well. Call `close` when it is no longer needed.
    """

    name = "llm"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC)

    def __init__(
        self, config: LlmConfig, fallback: Planner, caller: ModelCaller | None = None
    ) -> None:
        """`caller` can be shared with an interpreter.

        Raises:
            BadLlmConfig: the prompts that the configuration asks for cannot be used.
        """
        self._config = config
        self._fallback = fallback
        self._prompts = load_prompts(config)
        self._caller = caller or ModelCaller()
        self._conversation = Conversation(config, self._prompts, self._caller)

    @property
    def configured(self) -> bool:
        """Whether there is a model to ask."""
        return self._config.not_configured is None

    def interpreter(self, skills: Mapping[str, SkillModel]) -> LlmInterpreter:
        """An interpreter of goal sentences with the same model and the same processes."""
        return LlmInterpreter(self._config, skills, self._caller)

    def warm(self) -> None:
        """Start what takes seconds to start, if a model is configured. Blocks until it runs."""
        if self.configured:
            self._caller.warm()

    def close(self) -> None:
        """Stop asking: a call that is under way ends at once, and the fallback plans."""
        self._caller.close()

    def _solve(self, problem: PlanningProblem) -> Plan | NoPlan:
        if told := self._config.not_configured:
            return NoPlan(told)
        ledger = Ledger(self._config)
        goals = _open_goals(problem)
        try:
            made = self._ask(problem, goals, ledger)
        except Exception as error:
            # What a model says must never stop the fleet, whatever it is.
            log.exception("planning by language model")
            made = GivenUp(f"reading the answer failed: {error or type(error).__name__}")
        if isinstance(made, Plan):
            return replace(made, making=ledger.making(self.name, self._prompts))
        return self._fall_back(problem, made, ledger)

    def _ask(
        self, problem: PlanningProblem, goals: Sequence[Goal], ledger: Ledger
    ) -> Plan | GivenUp:
        if not goals:
            return merged((), problem, keep_order=True)
        if sought := _not_located(goals, problem.world):
            return GivenUp(f"nobody knows where {sought} is, and only {self._fallback.name} looks")
        drafts: list[Draft] = []
        world = problem.world
        # Together, goals that hold already are told, too: they must still hold at the end.
        parts = [(goal,) for goal in goals] if problem.strategy == PER_GOAL else [problem.goals]
        for part in parts:
            draft = self._draft(problem, part, world, ledger)
            if isinstance(draft, GivenUp):
                where = f"goal {part[0].goal}: " if len(parts) > 1 else ""
                return GivenUp(where + draft.reason, draft.violations)
            drafts.append(draft)
            world = world_after(draft, world)
        plan = merged(drafts, problem, keep_order=problem.strategy != MONOLITHIC)
        if violations := why_not(plan, problem.world):
            return GivenUp(
                f"the goals' plans do not go together: {violations[0].sentence}", violations
            )
        return plan

    def _draft(
        self, problem: PlanningProblem, goals: Sequence[Goal], world: WorldModel, ledger: Ledger
    ) -> Draft | GivenUp:
        """A draft for some goals, checked in `world`."""
        flat = problem.strategy == MONOLITHIC
        kind: type[GraphAnswer] | type[ListAnswer] = ListAnswer if flat else GraphAnswer
        max_tasks = self._config.max_tasks
        keep = [c for c in conditions_of(problem.goals) if world.holds(c)]

        def read(text: str) -> Draft | Rejected:
            answer = read_answer(text, kind)
            if isinstance(answer, str):
                return Rejected.because("malformed", answer)
            if len(answer.tasks) > max_tasks:
                sentence = f"the plan has {len(answer.tasks)} tasks; {max_tasks} are allowed"
                return Rejected.because("too-many-tasks", sentence)
            draft = draft_of(answer, world, goals)
            plan = plan_of(draft, problem, goals, keep)
            if violations := why_not(plan, world):
                return Rejected(violations)
            plan = without_useless(plan, world)
            return Draft(plan.tasks, plan.pins)

        return self._conversation.ask(
            system=self._prompts.fill("system"),
            question=self._prompts.fill(
                problem.strategy,
                skills=skills_text(useful_skills(world)),
                problem=problem_text(world, goals, keep),
                form=_FLAT_FORM if flat else _GRAPH_FORM,
            ),
            repair="repair",
            schema=plan_schema(world, goals, flat, max_tasks),
            read=read,
            ledger=ledger,
        )

    def _fall_back(
        self, problem: PlanningProblem, failed: GivenUp, ledger: Ledger
    ) -> Plan | NoPlan:
        log.warning("planning by language model failed: %s", failed.reason)
        strategies = self._fallback.strategies
        strategy = problem.strategy if problem.strategy in strategies else strategies[0]
        plan = self._fallback.plan(changed(problem, strategy=strategy))
        if isinstance(plan, NoPlan):
            return NoPlan(
                f"{plan.reason} (planner {self._fallback.name}; before that, {failed.reason})",
                plan.violations or failed.violations,
            )
        making: Making = ledger.making(self._fallback.name, self._prompts, failed.reason)
        # The strategy stays what was asked for: a new revision asks the model again.
        return replace(plan, making=making, strategy=problem.strategy)


def _open_goals(problem: PlanningProblem) -> list[Goal]:
    """Goals that do not hold yet, the most important first; the others need no task."""
    unmet = [
        goal
        for goal in problem.goals
        if not all(problem.world.holds(condition) for condition in goal.conditions)
    ]
    return sorted(unmet, key=lambda goal: (-goal.priority, goal.ordinal, goal.goal))


def _not_located(goals: Sequence[Goal], world: WorldModel) -> str | None:
    """Objects that a goal speaks of when it is not known where any of them is."""
    for goal in goals:
        for condition in goal.conditions:
            things = [subject for subject in condition.subjects if subject in world.objects]
            if things and all(world.value("at", thing) is None for thing in things):
                return " or ".join(things)
    return None


_GRAPH_FORM = """{"tasks": [{"task": "t1", "skill": "SKILL", "args": {"PARAMETER": "VALUE"}, \
"goal": "GOAL", "after": ["TASK"]}], "pins": [{"actor": "?a1", "robot": "ROBOT"}]}"""
_FLAT_FORM = """{"tasks": [{"skill": "SKILL", "args": {"PARAMETER": "VALUE"}, "goal": "GOAL"}], \
"pins": [{"actor": "?a1", "robot": "ROBOT"}]}"""
