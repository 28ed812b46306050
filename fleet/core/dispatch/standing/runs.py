"""Runs of schedules: each time that comes makes a goal, one at a time.

Times that pass while nobody is there (no planner runs, or its host sleeps) are done once, left
out, or all done, as the schedule says (`Missed`); a time that comes while the run before goes on is
left out or waits (`Overlap`). That a time has come, and what came of it, are one event: a planner
that is killed in between finds it to do, or done.
"""

from __future__ import annotations

from dataclasses import dataclass

from msgspec.structs import replace

from fleet.core.dispatch.standing.parts import begin_last_part, with_part
from fleet.core.model.recurrence import MOST_MISSED, Recurrence, recurrence_of, when_shown
from fleet.core.standing import run_due_s
from fleet.core.state import State
from fleet.core.state_updates import set_goal
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.schedules import Missed, Overlap, Schedule

LATE_S = 60.0
"""A run that begins later than this after its time was missed, and is made up for [s]."""
MOST_QUEUED = 100
"""More runs than this do not wait; the oldest are left out."""


def run(state: State, spec: Goal, status: GoalStatus) -> State:
    """Make the goal of a schedule whose time has come."""
    if status.state is not GoalState.STANDING:
        return state
    if status.next_s is None:
        status = replace(status, next_s=_first(spec, status, state))
    note = ""
    if status.next_s is not None and status.next_s <= state.time_s:
        status, note = _due(state, spec, status, recurrence_of(spec, state.time_zones()))
    if status != state.goal_states[spec.goal]:
        state = set_goal(state, status)
    if status.paused or status.parts or not status.queued_s:
        return state
    at_s, *waiting_s = status.queued_s
    if not note and state.time_s - at_s > LATE_S:
        note = f"it is the run of {when_shown(spec, at_s, state.time_zones())}"
    status = replace(status, queued_s=tuple(waiting_s), latest_s=state.time_s)
    state = set_goal(state, status)
    part = replace(spec, every=None, not_before_s=None, due_s=run_due_s(spec, status, state.time_s))
    state = with_part(state, spec.goal, part, status, note)
    made = state.goal_states[spec.goal]
    state = set_goal(state, replace(made, latest=made.parts[-1]))
    return begin_last_part(state, spec.goal)


def _first(spec: Goal, status: GoalStatus, state: State) -> float | None:
    """Its first time; of a schedule that was changed, the first one that is still to come."""
    times = recurrence_of(spec, state.time_zones())
    first_s = times.first()
    if first_s is None or first_s > state.time_s or not (status.runs or status.missed):
        return first_s
    return times.next_after(state.time_s)


def _due(state: State, spec: Goal, status: GoalStatus, times: Recurrence) -> tuple[GoalStatus, str]:
    """How a schedule stands once its times that have come are queued, missed or skipped; and what
    is to be said of the run that is made now."""
    assert status.next_s is not None
    passed = (status.next_s, *times.passed(status.next_s, state.time_s))
    status = replace(status, next_s=times.next_after(state.time_s))
    if status.paused:
        return status, ""
    schedule = state.schedules.get(spec.goal)
    owed = _Owed.of(passed, state.time_s, schedule, bool(status.parts or status.queued_s))
    queued_s = (*status.queued_s, *owed.at_s)
    missed = owed.missed + max(0, len(queued_s) - MOST_QUEUED)
    status = replace(
        status,
        queued_s=queued_s[-MOST_QUEUED:],
        missed=status.missed + missed,
        skipped=status.skipped + owed.skipped,
    )
    shown = when_shown(spec, passed[-1], state.time_zones())
    if owed.skipped:
        going_on = " and ".join(status.parts) or "the run before"
        reason = f"{going_on} still went on at {shown}, so that this time was left out"
        return replace(status, reason=reason), ""
    if not owed.at_s:
        reason = f"nobody was there to begin the run of {shown}, which was left out"
        return replace(status, reason=reason), ""
    if len(owed.at_s) == 1 < len(passed) and not owed.leaves_out:
        count = f"more than {MOST_MISSED}" if len(passed) > MOST_MISSED else str(len(passed))
        return status, f"it is done once for {count} times that have passed"
    return status, ""


@dataclass(frozen=True)
class _Owed:
    """What becomes of times that have come: those at `at_s` get a run each."""

    at_s: tuple[float, ...]
    missed: int
    skipped: int
    leaves_out: bool

    @classmethod
    def of(
        cls, passed: tuple[float, ...], time_s: float, schedule: Schedule | None, busy: bool
    ) -> _Owed:
        """`passed` are the times, `busy` says that a run goes on or waits."""
        policy = Missed.ONCE if schedule is None else schedule.missed
        overlap = Overlap.SKIP if schedule is None else schedule.overlap
        last = passed[-1:]
        in_time = last if time_s - last[0] <= LATE_S else ()
        made_up = {
            Missed.ONCE: last,
            Missed.SKIP: in_time,
            Missed.ALL: passed,
        }[policy]
        missed, skipped = len(passed) - len(made_up), 0
        if busy and overlap is Overlap.SKIP and made_up:
            # Where every time gets its run, one that nobody was there for waits even so.
            late = made_up[: len(made_up) - len(in_time)] if policy is Missed.ALL else ()
            skipped, made_up = len(made_up) - len(late), late
        return cls(made_up, missed, skipped, policy is Missed.SKIP)
