"""Programs for sentences: a symbolic plan for one robot, or for every place where a thing may be.

Where it is known where all is, the program is that plan's sequence of calls. Where something has
to be looked for first, it looks round by round, and goes on as planned for where that was found.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.model.parameter_types import ROBOT
from fleet.core.model.preconditions import made_true
from fleet.core.model.skills import Action
from fleet.core.model.task_graph import TaskGraph
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import MONOLITHIC, NoPlan, Planner, PlanningProblem
from fleet.planners.programs.base import ProgramTask, ProgramWriter
from fleet.planners.programs.text import Steps, Writer, branches, written
from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.programs import Program, ProgramStep

_log = logging.getLogger(__name__)

MADE_BY = "symbolic"
MOST_HYPOTHESES = 40
"""Where something may be found that has to be looked for; beyond them a program plans anew."""
Stages = tuple[tuple[Condition, ...], ...]


Writers = Mapping[str, Sequence[ProgramWriter]]
"""By the model of a robot, who is asked for its programs before the symbolic writer is."""


def with_programs(
    plan: Plan, world: WorldModel, planner: Planner, budget: TimeBudget, writers: Writers
) -> Plan | NoPlan:
    """The plan with a program for every sentence that has none yet, for a robot that can run it."""
    tasks: list[Task] = []
    pins = dict(plan.pins)
    for task in plan.tasks:
        program = task.program
        if program is not None and not program.code:
            facts = _facts_before(plan, task, world)
            pinned = pins.get(task.actor)
            now = changed(world, facts=facts)
            made = _for_some_robot(program, now, pinned, planner, budget, writers)
            if isinstance(made, NoPlan):
                return made
            pins[task.actor], program = made
            task = replace(task, program=program, duration_s=program.duration_s)
        tasks.append(task)
    return replace(plan, tasks=tuple(tasks), pins=pins)


def _for_some_robot(
    program: Program,
    world: WorldModel,
    pinned: str | None,
    planner: Planner,
    budget: TimeBudget,
    writers: Writers,
) -> tuple[str, Program] | NoPlan:
    refusal: NoPlan | None = None
    for robot in (pinned,) if pinned is not None else world.team:
        if robot not in world.available:
            refusal = refusal or NoPlan(f"{robot} is not connected")
            continue
        alone = changed(world, available=frozenset({robot}))
        for writer in writers.get(world.robots[robot].model, ()):
            written = writer.write(ProgramTask(program, alone, robot))
            if isinstance(written, Program):
                return robot, written
            _log.info("%s", written.reason)
        made = write_program(program, alone, robot, planner, budget)
        if isinstance(made, Program):
            return robot, made
        refusal = refusal or made
    return refusal or NoPlan("no robot is connected")


def write_program(
    program: Program, world: WorldModel, robot: str, planner: Planner, budget: TimeBudget
) -> Program | NoPlan:
    """The program of a sentence for one robot, in the world as it is."""
    alone = changed(world, available=frozenset({robot}))
    writing = _Writing(robot, planner, budget, Writer(world.skills, world.robots[robot].skills))
    found = writing.sequence(program.stages, alone)
    if isinstance(found, NoPlan):
        return found
    if isinstance(found, _Reached):
        steps = found.steps
        lines = writing.writer.sequence(steps) if steps else ["pass  # it is so already"]
        code = written(program.text, lines)
        return replace(program, code=code, made_by=MADE_BY, steps=steps, duration_s=found.seconds)
    return writing.with_search(program, alone, found)


@dataclass(frozen=True)
class _Reached:
    """A sequence of calls that reaches all stages, how long it takes [s], and what holds then."""

    steps: Steps
    seconds: float
    facts: Mapping[FactKey, Value]


@dataclass(frozen=True)
class _Lost:
    """It is not known where `thing` is; calls that look for it, round by round, and where."""

    thing: str
    rounds: tuple[Steps, ...]
    spots: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class _Writing:
    robot: str
    planner: Planner
    budget: TimeBudget
    writer: Writer

    def sequence(self, stages: Stages, world: WorldModel) -> _Reached | _Lost | NoPlan:
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
        return _Reached(tuple(steps), seconds, facts)

    def with_search(self, program: Program, world: WorldModel, lost: _Lost) -> Program | NoPlan:
        """Look for what is lost, and go on from wherever it was found."""
        cases: dict[tuple[str, ...], list[str]] = {}
        longest = 0.0
        refusal: NoPlan | None = None
        for spot in self._hypotheses(lost, world):
            facts = {**world.facts, FactKey(AT, lost.thing): spot}
            found = self.sequence(program.stages, changed(world, facts=facts))
            if isinstance(found, _Reached):
                body = tuple(self.writer.sequence(found.steps))
                cases.setdefault(body, []).append(spot)
                longest = max(longest, found.seconds)
            elif isinstance(found, NoPlan):
                refusal = refusal or found
        if not cases:
            return refusal or NoPlan(f"nobody knows where {lost.thing} is")
        lines = [
            *self.writer.looking((lost.thing,), lost.rounds),
            *branches(lost.thing, [(tuple(spots), list(body)) for body, spots in cases.items()]),
        ]
        return replace(
            program,
            code=written(program.text, lines),
            made_by=MADE_BY,
            duration_s=lost.seconds + longest,
        )

    def _search(self, stage: tuple[Condition, ...], world: WorldModel, thing: str) -> _Lost:
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
        return _Lost(thing, tuple(rounds), tuple(spots), seconds)

    def _hypotheses(self, lost: _Lost, world: WorldModel) -> Sequence[str]:
        """Where it may be found: in a spot, or on or in something that stands there."""
        spots = set(lost.spots)
        standing = sorted(
            name
            for name, thing in world.objects.items()
            if not thing.movable and name not in spots and (thing.home in spots or thing.part_of)
        )
        return [*lost.spots, *standing][:MOST_HYPOTHESES]

    def _problem(self, stage: tuple[Condition, ...], world: WorldModel) -> PlanningProblem:
        return PlanningProblem(
            plan="program",
            goals=(Goal(goal="wanted", text="wanted", conditions=stage),),
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


def _facts_before(plan: Plan, task: Task, world: WorldModel) -> dict[FactKey, Value]:
    """What holds when all that the task waits for is done, as far as that can be said."""
    facts = dict(world.facts)
    tasks = {each.task: each for each in plan.tasks}
    graph = TaskGraph({n: [b for b in t.after if b in tasks] for n, t in tasks.items()})
    for name in graph.order:
        each = tasks[name]
        skill = world.skills.get(each.skill)
        if not graph.precedes(name, task.task) or skill is None:
            continue
        if set(each.args) != set(skill.parameters):
            continue
        bound = {actor_arg(actor): robot for actor, robot in plan.pins.items()}
        action = skill.ground({n: bound.get(v, v) for n, v in each.args.items()})
        facts.update(made_true(action, facts, changed(world, facts=facts)))
    return facts
