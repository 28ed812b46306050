"""Replan triggers: what comes up that a plan does not provide for.

Here are facts against it, finds, conditions that do not hold at its end, and robots that came. A
task that failed is one in `handlers.reports`, one that cannot start in `ready_tasks`, a robot lost
or late in `lost_robots` and `delays`, a goal that changed in `handlers.goals`, a person's word in
`handlers.requests`. Each sets `PlanEntry.replan`; `revision.replanning` makes a planning job of it,
and the shell runs that: `planners.plan_repair` first, a new plan otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping

from fleet.core.model.preconditions import action_of
from fleet.core.model.skills import Action
from fleet.core.plan_entry import OUTSTANDING, PlanEntry, ReplanScope
from fleet.core.state import State
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState
from keyexpr_schema.payloads.world import Fact


def contradiction(state: State, entry: PlanEntry, fact: Fact) -> str | None:
    """Why a fact is against the plan: a task needs it otherwise, and nothing before it changes it.

    What a robot says of the work it is doing is part of that work.
    """
    known = fact.key
    unfinished = {
        record.task: (record, action)
        for record in entry.current()
        if record.state not in ENDED_TASKS
        and (action := action_of(record, state.skills)) is not None
    }
    for record, action in unfinished.values():
        needed = [literal for literal in action.before if literal.variable == known]
        if not needed or needed[0].value == fact.value:
            continue
        if record.state in OUTSTANDING and fact.source == record.robot:
            continue
        if not any(
            known == literal.variable
            for before in _before(record.task, unfinished)
            for literal in unfinished[before][1].after
        ):
            return f"{record.task} needs {needed[0]}, and {fact.source} says otherwise"
    return None


def _before(task: str, unfinished: Mapping[str, tuple[TaskRecord, Action]]) -> set[str]:
    """The unfinished tasks that come before a task."""
    befores: set[str] = set()
    ahead = [task]
    while ahead:
        record = unfinished[ahead.pop()][0]
        for before in (*record.after, *record.behind):
            if before in unfinished and before not in befores:
                befores.add(before)
                ahead.append(before)
    return befores


def why_replan(state: State, entry: PlanEntry) -> str | None:
    """What has come up that the plan does not provide for."""
    world = state.world()
    for thing in entry.plan.seeks:
        where = world.value(AT, thing)
        if where is not None:
            return f"{thing} was found: it is at {where}"
    current = list(entry.current())
    if all(record.state is TaskState.SUCCEEDED for record in current):
        for goal in entry.plan.goals:
            status = state.goal_states.get(goal)
            if status is None or status.state is GoalState.REACHED:
                continue
            unmet = [c for c in status.conditions if not world.holds(c)]
            if unmet:
                return f"every task is done, and {unmet[0]} does not hold"
    return None


def new_robots(state: State, entry: PlanEntry) -> PlanEntry | None:
    """The entry with robots that came since the plan was made as a reason to replan.

    More of a kind that is there already can share what is left. A new kind may help in ways that
    the plan knows nothing of, so that everything is planned again.
    """
    new = sorted(set(state.team()) - set(entry.team))
    if not entry.team or not new or all(r.state is not TaskState.WAITING for r in entry.current()):
        return None
    reason = f"{' and '.join(new)} can help now"
    kinds = {state.robots[robot].model for robot in entry.team if robot in state.robots}
    of_known_kinds = all(state.robots[robot].model in kinds for robot in new)
    return entry.to_replan(ReplanScope.REALLOCATE if of_known_kinds else ReplanScope.ANEW, reason)
