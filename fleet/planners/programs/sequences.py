"""What one robot does for stages of a sentence: a sequence of calls, or a search for something."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as changed

from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.preconditions import made_true
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import MONOLITHIC, NoPlan, Planner, PlanningProblem
from fleet.planners.programs.text import Steps, Writer
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.programs import ProgramStep

MOST_HYPOTHESES = 40
"""Where something may be found that has to be looked for; beyond them a program plans anew."""
Stages = tuple[tuple[Condition, ...], ...]


@dataclass(frozen=True)
class Reached:
    """A sequence of calls that reaches all stages, how long it takes [s], and what holds then."""

    steps: Steps
    seconds: float
    facts: Mapping[FactKey, Value]


@dataclass(frozen=True)
class Lost:
    """It is not known where `thing` is; calls that look for it, round by round, and where."""

    thing: str
    rounds: tuple[Steps, ...]
    spots: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Writing:
    """Plans what one robot does for a sentence; `always` and `never` are about its way."""

    robot: str
    planner: Planner
    budget: TimeBudget
    writer: Writer
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()

    def sequence(self, stages: Stages, world: WorldModel) -> Reached | Lost | NoPlan:
        """How the stages are reached, one after the other."""
        steps: list[ProgramStep] = []
        seconds, facts = 0.0, dict(world.facts)
        for stage in stages:
            now = changed(world, facts=facts)
            checked = self.planner.plan(self._problem(stage, now))
            if isinstance(checked, NoPlan):
                return checked
            if checked.plan.seeks:
                return self._search(stage, now, checked.plan.seeks[0])
            for name in checked.graph.order:
                action = self._own(checked.actions[name], now)
                seconds += now.duration_s(action, facts.get(FactKey(AT, self.robot)), self.robot)
                facts.update(made_true(action, facts, changed(now, facts=facts)))
                steps.append(self._step(action))
        return Reached(tuple(steps), seconds, facts)

    def _search(self, stage: tuple[Condition, ...], world: WorldModel, thing: str) -> Lost:
        """Everything where one can look, in rounds, until there is nothing left to look into."""
        rounds: list[Steps] = []
        spots: list[str] = []
        seconds = 0.0
        while not self.budget.over:
            problem = changed(self._problem(stage, world), searched=frozenset(spots))
            checked = self.planner.plan(problem)
            if isinstance(checked, NoPlan) or not checked.plan.seeks:
                break
            more = [c.subject for c in checked.plan.conditions if c.subject not in spots]
            if not more:
                break
            spots += more
            by_actor: dict[str, list[ProgramStep]] = {}
            for name in checked.graph.order:
                action = self._own(checked.actions[name], world)
                seconds += world.duration_s(action, None, self.robot)
                actor = checked.actions[name].actor
                by_actor.setdefault(actor, []).append(self._step(action))
            rounds += _by_round([step for steps in by_actor.values() for step in steps], more)
        return Lost(thing, tuple(rounds), tuple(spots), seconds)

    def hypotheses(self, lost: Lost, world: WorldModel) -> Sequence[str]:
        """Where it may be found: in a spot, or on or in something that stands there."""
        spots = set(lost.spots)
        standing = sorted(
            name
            for name, thing in world.objects.items()
            if not thing.movable and name not in spots and (thing.home in spots or thing.part_of)
        )
        return [*lost.spots, *standing][:MOST_HYPOTHESES]

    def _problem(self, stage: tuple[Condition, ...], world: WorldModel) -> PlanningProblem:
        wanted = Goal(
            goal="wanted", text="", conditions=stage, always=self.always, never=self.never
        )
        return PlanningProblem(
            plan="program",
            goals=(wanted,),
            world=world,
            strategy=MONOLITHIC,
            budget=self.budget,
        )

    def _own(self, action: Action, world: WorldModel) -> Action:
        """The action with the robot for every actor: there is no other."""
        robots = action.skill.robot_parameters
        args = {n: self.robot if n in robots else v for n, v in action.args.items()}
        return action.skill.ground(args)

    def _step(self, action: Action) -> ProgramStep:
        args = {n: ROBOT if v == self.robot else v for n, v in action.args.items()}
        return ProgramStep(skill=action.skill.name, args=args)


def _by_round(steps: Sequence[ProgramStep], spots: Sequence[str]) -> list[Steps]:
    """Calls cut behind each that looks into a spot: it is the last that names it."""
    rounds: list[Steps] = []
    round_: list[ProgramStep] = []
    last = {spot: max(i for i, s in enumerate(steps) if spot in s.args.values()) for spot in spots}
    for number, step in enumerate(steps):
        round_.append(step)
        if number in last.values():
            rounds.append(tuple(round_))
            round_ = []
    return [*rounds, tuple(round_)] if round_ else rounds
