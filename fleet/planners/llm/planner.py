"""The language-model planner: propose, verify, correct, and otherwise the symbolic planner."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

from fleet.core.checker.plan_checker import CheckedPlan, InvalidPlan
from fleet.core.model.derived import is_located
from fleet.core.model.world import WorldModel
from fleet.llm.budget import Budget
from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.structured_output import read_answer
from fleet.planners.base import BIG_DAG, MONOLITHIC, PER_GOAL, NoPlan, Planner, PlanningProblem
from fleet.planners.llm.action_elimination import without_redundant_tasks
from fleet.planners.llm.answers import GraphAnswer, ListAnswer, plan_schema
from fleet.planners.llm.candidate import (
    candidate_of,
    conditions_of,
    merged,
    verify,
    world_after,
)
from fleet.planners.llm.prompt_text import problem_text, skills_text, team_skills
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan

log = logging.getLogger(__name__)


class LlmPlanner(Planner):
    """Plans by a language model, within a budget; `fallback` takes over where that fails.

    Strategies: `big-dag` asks for one graph for all goals, `per-goal` for one graph for each goal,
    `monolithic` for one flat list, which is then deordered.

    Blocks while it asks: up to `max_wall_s` of the configuration, and the first time for the start
    of LiteLLM as well, unless the model is warm.
    """

    name = "llm"
    strategies = (BIG_DAG, PER_GOAL, MONOLITHIC)

    def __init__(self, model: LanguageModel, fallback: Planner) -> None:
        self._model = model
        self._fallback = fallback
        self.waiting_s = model.longest_s

    def _solve(self, problem: PlanningProblem) -> CheckedPlan | NoPlan:
        if reason := self._model.config.not_configured:
            return NoPlan(reason)
        budget = self._model.budget()
        try:
            made = self._propose(problem, budget)
        except Exception as error:
            # What a model says must never stop the fleet, whatever it is.
            log.exception("planning by language model")
            made = GivenUp(f"reading the answer failed: {str(error) or type(error).__name__}")
        if isinstance(made, CheckedPlan):
            return made.with_making(budget.making(self.name), problem.strategy)
        return self._fall_back(problem, made, budget)

    def _propose(self, problem: PlanningProblem, budget: Budget) -> CheckedPlan | GivenUp:
        """The model's plan, verified."""
        goals = _open_goals(problem)
        if sought := _not_located(goals, problem.world):
            return GivenUp(f"nobody knows where {sought} is, and only {self._fallback.name} looks")
        candidates: list[Plan] = []
        world = problem.world
        # Together, goals that hold already are listed, too: they must still hold at the end.
        together = [problem.goals] if goals else []
        groups = [(goal,) for goal in goals] if problem.strategy == PER_GOAL else together
        for group in groups:
            candidate = self._candidate(problem, group, world, budget)
            if isinstance(candidate, GivenUp):
                where = f"goal {group[0].goal}: " if len(groups) > 1 else ""
                return GivenUp(where + candidate.reason, candidate.violations)
            candidates.append(candidate)
            world = world_after(candidate, world)
        plan = merged(candidates, problem, keep_order=problem.strategy != MONOLITHIC)
        verified = verify(plan, problem.world)
        if isinstance(verified, InvalidPlan):
            sentence = verified.violations[0].sentence
            return GivenUp(f"the goals' plans do not go together: {sentence}", verified.violations)
        return verified

    def _candidate(
        self, problem: PlanningProblem, goals: Sequence[Goal], world: WorldModel, budget: Budget
    ) -> Plan | GivenUp:
        """A verified candidate for some goals in `world`, without redundant tasks."""
        flat = problem.strategy == MONOLITHIC
        form: type[GraphAnswer] | type[ListAnswer] = ListAnswer if flat else GraphAnswer
        max_tasks = self._model.config.max_tasks
        keep = [c for c in conditions_of(problem.goals) if world.holds(c)]

        def read(text: str) -> Plan | Rejected:
            answer = read_answer(text, form)
            if isinstance(answer, str):
                return Rejected.because("malformed", answer)
            if len(answer.tasks) > max_tasks:
                sentence = f"the plan has {len(answer.tasks)} tasks; {max_tasks} are allowed"
                return Rejected.because("too-many-tasks", sentence)
            plan = candidate_of(answer, problem, goals, world, keep)
            if violations := verify(plan, world).violations:
                return Rejected(violations)
            return without_redundant_tasks(plan, world)

        return self._model.ask(
            system="system",
            question=problem.strategy,
            correction="repair",
            values={
                "skills": skills_text(team_skills(world)),
                "problem": problem_text(world, goals, keep),
                "form": _FLAT_FORM if flat else _GRAPH_FORM,
            },
            schema=plan_schema(world, goals, flat, max_tasks),
            read=read,
            budget=budget,
        )

    def _fall_back(
        self, problem: PlanningProblem, failed: GivenUp, budget: Budget
    ) -> CheckedPlan | NoPlan:
        log.warning("planning by language model failed: %s", failed.reason)
        strategies = self._fallback.strategies
        strategy = problem.strategy if problem.strategy in strategies else strategies[0]
        budget_left = problem.budget.renewed()  # waiting for the model is no planning
        made = self._fallback.plan(replace(problem, strategy=strategy, budget=budget_left))
        if isinstance(made, NoPlan):
            return NoPlan(
                f"{made.reason} (planner {self._fallback.name}; before that, {failed.reason})",
                made.violations or failed.violations,
                made.postponed,
            )
        making = budget.making(self._fallback.name, failed.reason)
        # The strategy stays what was asked for: a new revision asks the model again.
        return made.with_making(making, problem.strategy)


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
            if things and not any(is_located(thing, world.facts.get, world) for thing in things):
                return " or ".join(things)
    return None


_GRAPH_FORM = """{"tasks": [{"task": "t1", "skill": "SKILL", "args": {"PARAMETER": "VALUE"}, \
"goal": "GOAL", "after": ["TASK"]}], "pins": [{"actor": "?a1", "robot": "ROBOT"}]}"""
_FLAT_FORM = """{"tasks": [{"skill": "SKILL", "args": {"PARAMETER": "VALUE"}, "goal": "GOAL"}], \
"pins": [{"actor": "?a1", "robot": "ROBOT"}]}"""
