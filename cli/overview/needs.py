"""What does not go on without a person, the most urgent first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import msgspec

from cli.client.stops import how_to_resume
from cli.overview.situation import ASKED, Situation
from cli.times import moment
from cli.views.text import counted
from keyexpr_schema.payloads.goals import GoalState, GoalStatus
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from keyexpr_schema.transport.clock_skew import ClockSkew

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from keyexpr_schema.payloads.system import UndecodableValue

UNREADABLE_SHOWN = 5
"""So many values that a component cannot read are told one by one."""

GONE = frozenset({WaitKind.AWAY, WaitKind.LOST})


class NeedsPerson(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Something that does not go on, or should not, without a person; `hint` says how it does."""

    kind: str
    about: tuple[str, ...]
    sentence: str
    hint: str | None = None


def needs_of(situation: Situation) -> list[NeedsPerson]:
    """What needs a person: stops, what is wrong, workers that cannot go on, clocks, empty
    batteries, questions, approvals, failures that nobody has seen to, robots that are gone, goals
    without a plan, and values that nobody can read."""
    kinds = (
        _stops, _unstored_stops, _diagnostics, _troubles, _clocks, _empty, _questions, _approvals,
        _failures, _gone, _unplanned, _unreadable,
    )  # fmt: skip
    return [each for found in kinds for each in found(situation)]


def _stops(of: Situation) -> Iterator[NeedsPerson]:
    for name, stop in sorted(of.view.stops.items()):
        held = of.view.held_by(stop)
        if not of.filters.any or of.filters.robots & {*held}:
            sentence = stop_sentence(stop, of.view)
            hint = how_to_resume(stop)
            yield NeedsPerson(kind="stop", about=(name,), sentence=sentence, hint=hint)


def _unstored_stops(of: Situation) -> Iterator[NeedsPerson]:
    """Robots that rest by a stop for which the store had no room."""
    for robot, _, state in of.robots:
        for stop in state.stops if state is not None else ():
            if stop not in of.view.stops:
                yield NeedsPerson(
                    kind="stop",
                    about=(stop,),
                    sentence=f"{robot} rests by emergency stop {stop}, which is not stored",
                    hint=f"robotctl resume --robot {robot}",
                )


def _diagnostics(of: Situation) -> Iterator[NeedsPerson]:
    for each in () if of.filters.any or of.health is None else of.health.diagnostics:
        often = f", {each.count} times" if each.count > 1 else ""
        since = moment(each.since_s)
        sentence = f"{each.component}: {each.sentence} (since {since}{often})"
        yield NeedsPerson(kind="diagnostic", about=(each.component,), sentence=sentence)


def _troubles(of: Situation) -> Iterator[NeedsPerson]:
    """What keeps workers that are there from their work; those of a process share it."""
    for robot, _, state in of.robots:
        if state is not None and state.trouble is not None and not of.is_away(robot):
            yield NeedsPerson(kind="trouble", about=(robot,), sentence=state.trouble)


def _clocks(of: Situation) -> Iterator[NeedsPerson]:
    """Clocks that are off by less than what keeps a worker from its work, which it says itself."""
    for robot, _, state in of.robots:
        if state is not None and state.clock_ahead_s and state.trouble is None:
            skew = ClockSkew(state.clock_ahead_s, 0.0)
            sentence = f"the clock of the host of {robot} is {skew}: set it right"
            yield NeedsPerson(kind="clock", about=(robot,), sentence=sentence)


def _empty(of: Situation) -> Iterator[NeedsPerson]:
    for robot, _, state in of.robots:
        if state is not None and state.charge is not None and state.charge <= 0.0:
            where = f" in {state.place}" if state.place else ""
            sentence = f"the battery of {robot} is empty: it stays{where} until somebody charges it"
            yield NeedsPerson(kind="empty", about=(robot,), sentence=sentence)


def _questions(of: Situation) -> Iterator[NeedsPerson]:
    for status in of.goals:
        for kind in ASKED & {reason.kind for reason in status.waits_for}:
            yield NeedsPerson(
                kind=kind.value,
                about=(status.goal,),
                sentence=f"goal {status.goal} asks: {status.reason}{_meanings(status)}",
                hint=f"robotctl goal answer {status.goal} WHICH",
            )


def _approvals(of: Situation) -> Iterator[NeedsPerson]:
    for status in of.unended:
        for reason in status.waits_for:
            done = {WaitKind.APPROVAL: "approve", WaitKind.START: "start"}.get(reason.kind)
            if done is not None:
                tasks, goals = of.counted(status.plan)[1], len(status.goals)
                yield NeedsPerson(
                    kind=reason.kind.value,
                    about=(status.plan,),
                    sentence=f"plan {status.plan} waits for {reason.kind.value}: "
                    f"{counted(tasks, 'task')} for {counted(goals, 'goal')}",
                    hint=f"robotctl plan {done} {status.plan}",
                )


def _failures(of: Situation) -> Iterator[NeedsPerson]:
    """Goals that failed, as long as nobody has tried them again or deleted them."""
    for status in of.ended()[0]:
        if status.state in (GoalState.FAILED, GoalState.REJECTED):
            again = "retry" if status.state is GoalState.FAILED else "delete"
            since = moment(status.wall_time_s, status.time_s)
            reason = f": {status.reason}" if status.reason else ""
            yield NeedsPerson(
                kind=status.state.value,
                about=(status.goal,),
                sentence=f"goal {status.goal} {_was(status.state)} {since}{reason}",
                hint=f"robotctl goal {again} {status.goal}",
            )


def _gone(of: Situation) -> Iterator[NeedsPerson]:
    """Robots that are not there while something waits for them."""
    waits: dict[str, tuple[WaitReason, int]] = {}
    for record in of.tasks:
        for reason in record.waits_for:
            if reason.kind in GONE and reason.robot is not None:
                waits[reason.robot] = (reason, waits.get(reason.robot, (reason, 0))[1] + 1)
    for robot, (reason, count) in sorted(waits.items()):
        since = f" since {moment(reason.since_wall_s)}" if reason.since_wall_s else ""
        tasks = f"{counted(count, 'task')} {'wait' if count > 1 else 'waits'} for it"
        yield NeedsPerson(
            kind=reason.kind.value,
            about=(robot,),
            sentence=f"{reason}{since}: {tasks}",
        )


def _unplanned(of: Situation) -> Iterator[NeedsPerson]:
    without = [(s.goal, r) for s in of.goals for r in s.waits_for if r.kind is WaitKind.NO_PLAN]
    for goal, reason in without:
        if reason.sentence:
            yield NeedsPerson(
                kind=WaitKind.NO_PLAN.value,
                about=(goal,),
                sentence=f"goal {goal} has no plan: {reason.sentence}",
                hint=f"robotctl plan create big-dag makespan {goal}",
            )
    if goals := tuple(goal for goal, reason in without if not reason.sentence):
        wait = f"{counted(len(goals), 'goal')} {'wait' if goals[1:] else 'waits'}"
        yield NeedsPerson(
            kind=WaitKind.NO_PLAN.value,
            about=goals,
            sentence=f"{wait} for a plan that nobody has asked for: {', '.join(goals)}",
            hint="robotctl plan create",
        )


def _unreadable(of: Situation) -> Iterator[NeedsPerson]:
    """A few values of each component by themselves, further ones in one sentence."""
    by_component: dict[str, list[UndecodableValue]] = {}
    for each in of.unreadable:
        by_component.setdefault(each.component, []).append(each)
    for component, values in by_component.items():
        shown = len(values) if len(values) == UNREADABLE_SHOWN + 1 else UNREADABLE_SHOWN
        for each in values[:shown]:
            often = f", {each.count} times" if each.count > 1 else ""
            sentence = f"{component} cannot read {each.keyexpr}{often}: {each.reason}"
            yield NeedsPerson(kind="unreadable", about=(each.keyexpr,), sentence=sentence)
        if others := values[shown:]:
            # The one met most often, whose reason may tell how many more there are.
            one = max(others, key=lambda value: value.count)
            yield NeedsPerson(
                kind="unreadable",
                about=tuple(each.keyexpr for each in others),
                sentence=f"{component} cannot read {len(others)} more values, such as "
                f"{one.keyexpr}: {one.reason}",
            )


def stop_sentence(stop: Stop, view: FleetView) -> str:
    """Whom an emergency stop holds, and who of them has not said that it rests."""
    held = view.held_by(stop)
    if stop.robots:
        whom = ", ".join(r if r in held else f"{r} (not registered)" for r in _named(stop, view))
    else:
        whom = f"all robots ({', '.join(held)})" if held else "those that come"
    silent = [
        robot
        for robot in held
        if robot not in view.robot_states or stop.stop not in view.robot_states[robot].stops
    ]
    missing = f"; NOT CONFIRMED by {', '.join(silent)}" if silent else ""
    return f"{stop} holds {whom or 'nobody'}{missing}"


def _named(stop: Stop, view: FleetView) -> list[str]:
    return [robot for robot in stop.robots if stop.holds(robot, view.stop_releases)]


def _meanings(status: GoalStatus) -> str:
    listed = (f"{number}: {words}" for number, words in enumerate(status.candidates, 1))
    return f" ({'; '.join(listed)})" if status.candidates else ""


def _was(state: GoalState) -> str:
    return "failed" if state is GoalState.FAILED else f"was {state.value}"
