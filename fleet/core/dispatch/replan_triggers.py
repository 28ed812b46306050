"""Replan triggers: what comes up that a plan does not provide for.

Here are facts against it, finds, conditions that do not hold at its end, and robots that came. A
task that failed is one in `handlers.reports`, one that cannot start in `ready_tasks`, a robot lost
or late in `lost_robots` and `delays`, a goal that changed in `handlers.goals`, a person's word in
`handlers.requests`. Each sets `PlanEntry.replan`; `revision.replanning` makes a planning job of it,
and the shell runs that: `planners.plan_repair` first, a new plan otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fleet.core.belief_updates import ONE_VARIABLE_SINCE_LOGIC
from fleet.core.dispatch.trajectory import broken
from fleet.core.dispatch.while_replanning import stands_still
from fleet.core.indexes.fleet_index import carried_by
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.model.derived import holds
from fleet.core.model.formulas.abstraction import reads
from fleet.core.model.formulas.evaluation import evaluate, expanded
from fleet.core.model.formulas.nodes import Formula, Holds
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.preconditions import ANY, action_of, spoken_of, written_by
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import ReplanScope
from fleet.core.state import State
from fleet.core.state_updates import set_entry
from keyexpr_schema.facts import AT, IN, ON, REACHABLE, FactKey, Literal
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord
from keyexpr_schema.payloads.world import Fact

EMPTY_SINCE_LOGIC = 7
"""Before, work of a robot whose battery ran empty waited until somebody had charged it."""


def react_to_fact(state: State, fact: Fact, said_again: bool = False) -> State:
    """Have the running plans repaired that a fact which is believed now is against; not once more,
    if it was only `said_again`."""
    for plan in state.index.active:
        entry = state.plans[plan]
        if entry.state is not PlanState.RUNNING or stands_still(state, entry):
            continue
        if said_again and any(fact.key in reason.variables for reason in entry.reasons):
            continue  # it is being seen to
        if (against := contradicted(state, entry, fact)) is not None:
            state = set_entry(state, against)
    return state


def contradicted(state: State, entry: PlanEntry, fact: Fact) -> PlanEntry | None:
    """The entry with a fact against it as a reason to replan, if it is one: a task needs it
    otherwise, and nothing before it changes it.

    What a robot says of the work it is doing is part of that work. So is what anybody says that
    the work is just making true, or that it found when it began and is heard of only now.
    """
    world = state.world()
    for task, needed in _needs_about(state, entry, fact.key):
        record = entry.records[task]
        if evaluate(needed, world.facts.get, world) or _is_still_to_be_made(
            entry, task, needed, world
        ):
            continue
        if record.state in OUTSTANDING and fact.source == record.robot:
            continue
        if state.plans_while_acting and _is_being_made(state, entry, fact):
            return None
        sentence = f"{record.task} needs {formula_text(needed)}, and {fact.source} says otherwise"
        return entry.to_replan(
            ReplanScope.REPAIR,
            sentence,
            goals=(record.goal,),
            tasks=(record.task,),
            variables=(fact.key,),
        )
    return None


def _needs_about(state: State, entry: PlanEntry, known: FactKey) -> Iterator[tuple[str, Formula]]:
    """What tasks need of the variable, or of what is where its subject is, as nothing before them
    provides it."""
    variables = [known]
    if known.subject not in state.places and state.logic >= ONE_VARIABLE_SINCE_LOGIC:
        for name in carried_by(state.index, known.subject):
            variables.extend(FactKey(relation, name) for relation in (AT, ON, IN, REACHABLE))
    variables += [FactKey(relation, ANY) for relation, _ in dict.fromkeys(variables)]
    for variable in dict.fromkeys(variables):
        for task in entry.index.exposed.get(variable, ()):
            action = action_of(entry.records[task], state.skills)
            for row in action.before if action is not None else ():
                if row.variable == variable:
                    yield task, Holds(row)
            for formula in action.conditions if action is not None else ():
                if variable in spoken_of(formula):
                    yield task, formula


def _is_still_to_be_made(entry: PlanEntry, task: str, needed: Formula, world: WorldModel) -> bool:
    """Whether something that the need is read off is yet to change: of what it names, by tasks
    before, and of what else it is read off, by any other."""
    graph = entry.index.graph
    formula = expanded(needed, world)
    read = reads(formula, lambda key: (world.facts.get(key),), world)
    for variable in read:
        names: Iterable[str] = graph.suppliers.get((task, variable), ())
        if variable not in graph.needs[task]:
            of_any = FactKey(variable.relation, ANY)
            names = (*graph.setters.get(variable, ()), *graph.setters.get(of_any, ()))
        if any(n != task and entry.records[n].state not in ENDED_TASKS for n in names):
            return True
    return False


def _is_being_made(state: State, entry: PlanEntry, fact: Fact) -> bool:
    under_way = (r for r in entry.outstanding() if r.task in entry.index.graph.position)
    actions = ((record, action_of(record, state.skills)) for record in under_way)
    world = state.world()
    return any(
        action and _is_of_its_making(record, action, fact, world) for record, action in actions
    )


def _is_of_its_making(record: TaskRecord, action: Action, fact: Fact, world: WorldModel) -> bool:
    """Whether a fact that is believed says what a task under way makes true, perhaps more finely,
    or what it found when it began."""

    def is_said(rows: Iterable[Literal]) -> bool:
        return any(
            row.variable == fact.key
            and (row.value == fact.value or holds(row, world.facts.get, world))
            for row in rows
        )

    if is_said(action.after):
        return True
    changed = {*written_by(action)} - {row.variable for row in action.after}
    if not changed.isdisjoint((fact.key, FactKey(fact.relation, ANY))):
        return True
    begun_s = record.ordered_s if record.started_s is None else record.started_s
    return is_said(action.before) and begun_s is not None and 0.0 < fact.time_s < begun_s


def unforeseen(state: State, entry: PlanEntry) -> PlanEntry | None:
    """The entry with what has come up that the plan does not provide for, if anything has."""
    return (
        _found_or_not_done(state, entry)
        or broken(state, entry, entry.plan.goals)
        or _empty_robots(state, entry)
        or _new_robots(state, entry)
    )


def _found_or_not_done(state: State, entry: PlanEntry) -> PlanEntry | None:
    world = state.world()
    for thing in entry.plan.seeks:
        where = world.value(AT, thing)
        if where is not None:
            sentence = f"{thing} was found: it is at {where}"
            return entry.to_replan(ReplanScope.REPAIR, sentence, whole=True)
    if entry.index.unfinished == 0:
        for goal in entry.plan.goals:
            status = state.goal_states.get(goal)
            if status is None or status.state is GoalState.REACHED:
                continue
            unmet = [c for c in status.conditions if not world.holds(c)]
            if unmet:
                sentence = f"every task is done, and {unmet[0]} does not hold"
                return entry.to_replan(ReplanScope.REPAIR, sentence, goals=(goal,))
    return None


def _empty_robots(state: State, entry: PlanEntry) -> PlanEntry | None:
    """With what robots were to do whose batteries are empty: they stay where they are."""
    if state.logic < EMPTY_SINCE_LOGIC:
        return None
    out = tuple(
        robot
        for robot in entry.team
        if robot in entry.index.needs and robot not in state.index.work and state.is_empty(robot)
    )
    if not out:
        return None
    reason = f"the battery of {' and '.join(out)} is empty"
    return entry.to_replan(ReplanScope.REALLOCATE, reason, robots=out)


def _new_robots(state: State, entry: PlanEntry) -> PlanEntry | None:
    """With robots that came since the plan was made.

    More of a kind that is there already can share what is left. A new kind may help in ways that
    the plan knows nothing of, so that everything is planned again.
    """
    if not entry.team or entry.team == state.team() or not entry.index.waiting:
        return None
    new = sorted(set(state.team()) - set(entry.team))
    if not new:
        return None
    sentence = f"{' and '.join(new)} can help now"
    kinds = {state.robots[robot].model for robot in entry.team if robot in state.robots}
    of_known_kinds = all(state.robots[robot].model in kinds for robot in new)
    return entry.to_replan(ReplanScope.REALLOCATE if of_known_kinds else ReplanScope.ANEW, sentence)
