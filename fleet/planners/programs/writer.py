"""Programs for sentences: a symbolic plan for one robot, or for every place where a thing may be.

Where it is known where all is, the program is that plan's sequence of calls. Where something has
to be looked for first, it looks round by round, and goes on as planned for where that was found.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace as changed

from msgspec.structs import replace

from fleet.core.model.preconditions import made_true
from fleet.core.model.task_graph import Cycle, TaskGraph
from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners.base import NoPlan, Planner
from fleet.planners.programs.base import ProgramTask, ProgramWriter
from fleet.planners.programs.parts import Parts
from fleet.planners.programs.sequences import Reached, Writing
from fleet.planners.programs.text import Writer, written
from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.programs import Program, ProgramPart

_log = logging.getLogger(__name__)

MADE_BY = "symbolic"

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
            try:
                facts = _facts_before(plan, task, world)
            except Cycle:
                return plan  # which the checker says
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
        # Others' programs are rehearsed against what shall hold in any case.
        for writer in writers.get(world.robots[robot].model, ()) if not program.parts else ():
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
    writer = Writer(world.skills, world.robots[robot].skills)
    writing = Writing(robot, planner, budget, writer, program.always, program.never)
    if not program.parts:
        found = writing.sequence(program.stages, alone)
        if isinstance(found, NoPlan):
            return found
        if isinstance(found, Reached):
            steps = found.steps
            lines = writer.sequence(steps) if steps else ["pass  # it is so already"]
            code = written(program.text, lines)
            return replace(
                program, code=code, made_by=MADE_BY, steps=steps, duration_s=found.seconds
            )
        body = Parts(writing).looked_for(found, (ProgramPart(stages=program.stages),), alone)
    else:
        body = Parts(writing).body(program.parts, alone)
    if isinstance(body, NoPlan):
        return body
    code = written(program.text, body.lines or ["pass  # it is so already"])
    return replace(program, code=code, made_by=MADE_BY, duration_s=body.seconds)


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
