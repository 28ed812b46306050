"""Goals: what they are understood to mean, stage by stage."""

from __future__ import annotations

import dataclasses

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import conclude, take_word
from fleet.core.dispatch.activation import begin_stage
from fleet.core.dispatch.concerns import HELD
from fleet.core.dispatch.put_downs import holder_of, note_what_is_carried
from fleet.core.dispatch.standing.goals import begin, look_again
from fleet.core.dispatch.standing.parts import with_part
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.indexes.fleet_index import EMPTY
from fleet.core.indexes.touches import Part, Touch
from fleet.core.over import goal_taken_back
from fleet.core.plan_entry import PlanEntry
from fleet.core.replan_reasons import GoalsAdded, ReplanScope
from fleet.core.standing import is_part, is_repeated, is_scheduled, wanted_by
from fleet.core.state import State
from fleet.core.state_updates import (
    cancel,
    set_entry,
    set_goal,
    set_spec,
    touch,
    without_goal,
)
from fleet.core.understanding import Understood, understood
from fleet.language import Reading
from keyexpr_schema.facts import AT, IN, LOCATED, ON
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.world import Fact

URGENCY_SINCE_LOGIC = 6
"""Before, a goal began anew when it became more urgent."""
SAME_THINGS_SINCE_LOGIC = 8
"""Before, a goal that waited came to mean another thing while its own was unknown."""
RUNS_STAY_SINCE_LOGIC = 6
"""Before, the run of a schedule that was deleted went with it."""
IN_OTHER_WORDS_SINCE_LOGIC = 5
"""Before, a language model was asked about questions back, too, and what the fleet cannot do."""


def goal_put(state: State, event: events.GoalPut) -> State:
    """Keep the goal and say what it is understood to mean; a changed goal begins anew."""
    return take_put_goal(state, event.goal)


def take_put_goal(state: State, goal: Goal) -> State:
    """Keep a goal that was put, on its own key or by a schedule."""
    known, before = state.goal_states.get(goal.goal), state.goals.get(goal.goal)
    said = state.goal_specs.get(goal.goal, before)
    if said == goal:
        return state
    if before is None and known is not None and known.state in ENDED_GOALS:
        return set_spec(state, goal)  # under an earlier planner
    if (
        state.logic >= URGENCY_SINCE_LOGIC
        and said is not None
        and said.wants_same(goal)
        and known is not None
        and known.state not in ENDED_GOALS
    ):
        return _of_other_urgency(state, said, goal)
    same_words = said is not None and (goal.text, goal.speaker) == (said.text, said.speaker)
    # A model that knew no other words may have been away.
    asked = known if same_words and known is not None and known.paraphrase is not None else None
    if before is None:
        return _take_goal(state, goal, understood(state, goal, known, asked))
    read = understood(state, goal, None, asked)
    if known is not None and _leaves_runs(state, before) and is_repeated(read.goal):
        read = dataclasses.replace(read, status=_with_runs_of(read.status, known))
    else:
        for part in known.parts if known is not None else ():
            state = drop_goal(state, part)
        read = understood(state, goal, None, asked)
    state = replace(state, waiting_for_robots=state.waiting_for_robots.without(goal.goal))
    state = _take_goal(state, goal, read)
    if state.goal_states[goal.goal].state in (*HELD, GoalState.NOT_NEEDED):
        state = _without_work(state, goal.goal, f"goal {goal.goal} is for later now")
    return state


def _with_runs_of(status: GoalStatus, known: GoalStatus) -> GoalStatus:
    """What goes on of a schedule that was changed goes on, and its runs are counted on."""
    return replace(
        status,
        parts=known.parts,
        runs=known.runs,
        latest=known.latest,
        latest_s=known.latest_s,
        missed=known.missed,
        skipped=known.skipped,
    )


def _of_other_urgency(state: State, said: Goal, goal: Goal) -> State:
    """With another priority or another time at which it is due, of its parts, too: robots and plans
    go by that from now on, and what goes on stays as it is."""
    changed = {
        name: getattr(goal, name)
        for name in ("priority", "due_s", "said_by")
        if getattr(goal, name) != getattr(said, name)
    }
    state = set_spec(state, goal, replace(state.goals[goal.goal], **changed))
    if is_repeated(goal):
        changed.pop("due_s", None)  # that of a run is none of the next one
    for part in state.goal_states[goal.goal].parts:
        if part in state.goals:
            state = set_spec(state, replace(state.goals[part], **changed))
    return touch(state, Touch(Part.GOAL, goal.goal))


def goal_deleted(state: State, event: events.GoalDeleted) -> State:
    """Drop the goal; a plan that works on it is made again without it."""
    if event.goal not in state.goals or _belongs_to_another(state, event.goal):
        return state
    status = state.goal_states.get(event.goal)
    state = drop_goal(state, event.goal)
    if status is not None and status.part_of is not None:
        state = look_again(state, status.part_of)
    schedule = state.schedules.get(event.goal)  # it was in this one's place
    return state if schedule is None else take_put_goal(state, wanted_by(schedule))


def _belongs_to_another(state: State, goal: str) -> bool:
    """Whether a goal goes only with what made it; runs of schedules can be taken back alone."""
    if is_scheduled(state, goal):
        return True
    if not is_part(state, goal):
        return False
    whole = state.goals.get(state.goal_states[goal].part_of or "")
    return whole is not None and not _leaves_runs(state, whole)


def _leaves_runs(state: State, goal: Goal) -> bool:
    """Whether what a goal has made goes on without it."""
    return is_repeated(goal) and state.logic >= RUNS_STAY_SINCE_LOGIC


def drop_goal(state: State, goal: str) -> State:
    """Without a goal that was deleted, and without those that it has made, but for runs."""
    status, spec = state.goal_states.get(goal), state.goals.get(goal)
    parts = status.parts if status is not None else ()
    for part in () if spec is not None and _leaves_runs(state, spec) else parts:
        state = drop_goal(state, part)
    state, before = note_what_is_carried(state, goal), state.to_put_down
    held = [t for t in state.to_put_down if t not in before and holder_of(state, t)]
    state = goal_taken_back(state, goal)
    state = replace(state, waiting_for_robots=state.waiting_for_robots.without(goal))
    in_hand = f" while {' and '.join(held)} was in the hand" if held else ""
    return _without_work(state, goal, f"goal {goal} was deleted{in_hand}")


def _without_work(state: State, goal: str, sentence: str) -> State:
    for plan in state.index.plans_of.get(goal, ()):
        state = _goal_taken_out(state, state.plans[plan], goal, sentence)
    return state


def _goal_taken_out(state: State, entry: PlanEntry, goal: str, sentence: str) -> State:
    """Work on the goal no more; a wish for nothing else is refused."""
    for wish in [wish for wish in entry.wishes if goal in wish.goals]:
        rest = tuple(other for other in wish.goals if other != goal)
        if not rest and isinstance(wish, GoalsAdded):
            entry = replace(entry, wishes=tuple(w for w in entry.wishes if w is not wish))
        else:
            smaller = replace(wish, goals=rest)
            wishes = tuple(smaller if w is wish else w for w in entry.wishes)
            entry = replace(entry, wishes=wishes)
    in_work = entry.plan.goals if entry.job is None else (*entry.plan.goals, *entry.job.goals)
    if goal in in_work:
        entry = replace(entry, plan=without_goal(state, entry.plan, goal))
        entry = entry.to_replan(ReplanScope.REALLOCATE, sentence, goals=(goal,))
    return set_entry(state, entry) if entry.wanted_goals else cancel(state, entry, sentence)


def goal_interpreted(state: State, event: events.GoalInterpreted) -> State:
    """Read how a language model says a goal's sentence, or take over that it knows no other words.

    What models of earlier versions have read in one is taken over as it was.
    """
    goal = state.goals.get(event.goal)
    if event.goal not in state.interpreting or (
        goal is not None and event.text not in (None, goal.text)
    ):
        return state
    state = _without_reading(state, event.goal)
    status = state.goal_states.get(event.goal)
    if status is None:
        return state
    if event.paraphrase is not None and goal is not None:
        said = replace(status, paraphrase=event.paraphrase, teaches=event.teaches)
        goal = state.goal_specs.get(goal.goal, goal)
        return _take_goal(state, goal, understood(state, goal, said, said))
    if not event.stages:
        reason = f"{status.reason}; a language model did not understand it either: {event.reason}"
        return set_goal(state, replace(status, state=GoalState.REJECTED, reason=reason))
    state = set_goal(
        state,
        replace(
            status,
            state=GoalState.WAITING,
            stages=event.stages,
            conditions=event.stages[0],
            reason=None,
        ),
    )
    return begin(state, event.goal)


def understand_again(state: State, new: str | None = None) -> State:
    """Read goals' sentences again, now that there are other names: `new` is the one that came.

    What a goal that waits means changes only to take that one in. While a thing of its own is
    unknown for a moment, "cup 1" does not come to mean another.
    """
    listed = state.index.in_state
    names = (*listed.get(GoalState.WAITING, EMPTY), *listed.get(GoalState.REJECTED, EMPTY))
    put = (state.goals[n] for n in names if n in state.goals and not is_part(state, n))
    for goal in sorted(put, key=_in_order):
        status = state.goal_states[goal.goal]
        goal = state.goal_specs.get(goal.goal, goal)
        read = understood(state, goal, status, status)
        if status.state is GoalState.REJECTED and read.status.reason != status.reason:
            state = _take_goal(state, goal, read)
        elif (
            status.state is GoalState.WAITING
            and read.status.stages
            and read.status.stages != status.stages
            and read.status.paraphrase == status.paraphrase
            and _takes_in(state, new, status, read.status)
        ):
            # "some robot" now has more to choose from
            state = set_goal(set_spec(state, goal, read.goal), read.status)
    return state


def _takes_in(state: State, new: str | None, status: GoalStatus, read: GoalStatus) -> bool:
    """Whether another reading of a goal is about a name that came, and all that it was about is
    known."""
    if state.logic < SAME_THINGS_SINCE_LOGIC:
        return True
    known = (state.objects, state.places, state.robots)
    there = all(any(name in names for names in known) for name in _things_of(status))
    return there and (new is None or new in _things_of(read))


def _things_of(status: GoalStatus) -> set[str]:
    """What the stages of a goal are about: things, robots, and the places where they shall be."""
    rows = [row for stage in status.stages for row in stage]
    found = {name for row in rows for name in row.subjects}
    return found | {str(row.value) for row in rows if row.relation in (AT, ON, IN) and row.value}


def next_stage(state: State, goal: str) -> State:
    """A goal goes on with what it wants next; what was brought somewhere before stays there."""
    status = state.goal_states[goal]
    number = status.stage + 1
    wanted = status.stages[number]
    about = {subject for condition in wanted for subject in condition.subjects}
    kept = tuple(
        condition
        for condition in status.conditions
        if condition.relation in (AT, ON, IN)
        and about.isdisjoint(condition.subjects)
        and not state.robots.keys() & set(condition.subjects)
    )
    status = replace(status, stage=number, conditions=(*wanted, *kept))
    return begin_stage(set_goal(state, status), goal)


def _take_goal(state: State, goal: Goal, read: Understood) -> State:
    """Say what a goal means; a sentence that the grammar refuses may go to a language model."""
    status = read.status
    state = set_goal(set_spec(state, goal, read.goal), status)
    state = _presume(state, goal.goal, read.reading)
    source = f"{PLANNER_SOURCE}:{goal.goal}"
    state, _ = take_word(state, read.reading.facts, source, goal.said_s or state.time_s)
    if state.policy.interpreter and _is_for_model(state, goal, read):
        state = set_goal(state, replace(status, state=GoalState.READING, refusal=status.reason))
        interpreting = tuple(dict.fromkeys([*state.interpreting, goal.goal]))
        state = replace(state, interpreting=interpreting)
        return touch(state, Touch(Part.INTERPRETING, goal.goal))
    state = _without_reading(state, goal.goal)
    about: dict[str, set[str]] = {}
    before: tuple[str, ...] = ()
    for (part, means), wanted in zip(read.parts, read.reading.goals, strict=False):
        asked = {name for row in (*part.when, *part.only_if) for name in row.subjects}
        if not wanted.otherwise:
            before = tuple(name for name, subjects in about.items() if subjects & asked)
        elif not before and any(row.relation == LOCATED for row in part.only_if):
            before = tuple(about)[-1:]  # to bring something if it is found includes the search
        # Else both are asked at the same time: what one brings about is no reason for the other.
        state = with_part(state, goal.goal, replace(part, after=before), means)
        name = state.goal_states[goal.goal].parts[-1]
        about[name] = {each for stage in means.stages for row in stage for each in row.subjects}
        state = begin(state, name)
    return begin(state, goal.goal) if status.state is not GoalState.REJECTED else state


def _is_for_model(state: State, goal: Goal, read: Understood) -> bool:
    """Whether a language model is asked to say a goal's sentence in other words."""
    if state.logic < IN_OTHER_WORDS_SINCE_LOGIC:
        return read.status.state is GoalState.REJECTED and not goal.conditions
    return read.unread


def _without_reading(state: State, goal: str) -> State:
    """Nobody reads the goal's sentence any more, or what it was before."""
    if goal not in state.interpreting:
        return state
    return replace(state, interpreting=tuple(g for g in state.interpreting if g != goal))


def _in_order(goal: Goal) -> tuple[int, str]:
    return goal.ordinal, goal.goal


def _presume(state: State, goal: str, reading: Reading) -> State:
    """Believe what a goal takes for granted where nothing is known, as if it had been stated."""
    for literal in reading.presumed:
        fact = state.fact(*literal.variable)
        if fact is None or fact.value is None:
            source = f"{PLANNER_SOURCE}:{goal}"
            state = conclude(state, Fact.of(literal, source, state.time_s))
    return state
