"""Goals as their sentences end, and when they are wanted: the times that a sentence names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime
from itertools import product

from fleet.errors import NotUnderstood
from fleet.language.meanings.conditions import negation_of
from fleet.language.reading import WantedGoal
from fleet.language.refusals import reason_for
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.stages import GoalDraft
from fleet.language.resolve.wish import PLACED
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.times import hour_in
from keyexpr_schema.payloads.goals import Condition

_HALF_A_DAY_S = 43_200.0
_AS_LONG_AS_IT_STANDS = (
    "which a goal cannot: what is kept or avoided is so from a time on, until the goal is deleted "
    "(`robotctl goal delete`)"
)


def timed(goal: WantedGoal, said: Discourse, now: datetime | None) -> WantedGoal:
    """The goal with the times that were said.

    Raises:
        NotUnderstood: a time of day was said, and what time it is now is not known, or what was
            said is no time that a goal can have.
    """
    _check_times(goal, said)
    every = next((time for time in said.times if time.kind == "every"), None)
    kinds = [time.kind for time in said.times]
    if any(kinds.count(kind) > 1 for kind in kinds):
        raise NotUnderstood(f"{said.time_words!r} are two times for one thing: say one each")
    for time in said.times:
        if time is every:
            at = next((t for t in said.times if t.kind == "start" and t.hour is not None), None)
            if at is not None and time.every_s is None:
                time = replace(time, hour=hour_in(time.part, at.hour or 0), minute=at.minute)
            goal = replace(goal, every=time.recurrence)
            continue
        if every is not None and time.kind == "start" and time.hour is not None:
            continue
        if time.after_s is None and now is None:
            raise NotUnderstood("a time of day is named, and what time it is now is not known")
        seconds = time.after_s if now is None or time.after_s is not None else time.seconds(now)
        if time.until is not None and now is not None:
            (hour, minute), begins_s = time.until, time.seconds(now)
            lasts_s = 3600.0 * (hour - (time.hour or 0)) + 60.0 * (minute - time.minute)
            while lasts_s <= 0.0:  # "between 10 and 3"
                lasts_s += _HALF_A_DAY_S
            goal = replace(goal, due_s=begins_s + lasts_s)
        if time.kind == "due" or (time.hour is not None and not said.done):
            goal = replace(goal, due_s=seconds)
        else:
            goal = replace(goal, not_before_s=seconds)
    return goal


def _otherwise(goal: WantedGoal, said: Discourse) -> WantedGoal:
    """A goal for when the condition of the one before does not hold, at the time of that one.

    Raises:
        NotUnderstood: it has a time of its own, so that it would be asked twice.
    """
    before = next(each for each in reversed(said.goals) if not each.otherwise)
    if said.times:
        raise NotUnderstood(
            f"{said.time_words!r} is a time of its own for what is done otherwise: say when it is "
            'asked before the "if"'
        )
    every, not_before_s = before.every, before.not_before_s
    return replace(goal, otherwise=True, every=every, not_before_s=not_before_s)


def _check_times(goal: WantedGoal, said: Discourse) -> None:
    """Whether a goal can have the times that were said, all of them.

    Raises:
        NotUnderstood: it cannot; one sentence that names them.
    """
    named = repr(said.time_words)
    kinds = {time.kind for time in said.times}
    if "for" in kinds:
        raise NotUnderstood(f"{named} says for how long, {_AS_LONG_AS_IT_STANDS}")
    if "often" in kinds:
        raise NotUnderstood(
            f'{named} says how often in a way that goals cannot; they know "every two hours", '
            '"every morning", "on Mondays at 7" and "whenever the door is open"'
        )
    if goal.whenever and said.times:
        raise NotUnderstood(
            f"{named} names a time for what is done each time that something comes to hold, which "
            "is begun at once then"
        )
    every = next((time for time in said.times if time.kind == "every"), None)
    at = next((t for t in said.times if t.kind == "start" and t.hour is not None), None)
    if every is not None and at is not None and (every.every_s is not None or at.until):
        raise NotUnderstood(
            f'{named}: a time of day goes with days only, and no window does; say it like "every '
            'day at 7" or "every two hours"'
        )
    if said.times and _undone(goal):
        raise NotUnderstood(
            f"{said.line!r}: it is not said whether {named} goes for what is done and for what is "
            "undone: say it as two goals"
        )
    if goal.always or goal.never:
        _check_lasting(goal, said)


def _undone(goal: WantedGoal) -> bool:
    """Whether it wants something, and then the contrary: "turn it on and off in an hour"."""
    known: dict[tuple[str, str], object] = {}
    for row in (row for stage in goal.stages for row in stage if isinstance(row.value, bool)):
        if known.setdefault((row.relation, row.subject), row.value) != row.value:
            return True
    return False


def _check_lasting(goal: WantedGoal, said: Discourse) -> None:
    """Whether what is kept or avoided can be at these times: from when on, and no more.

    Raises:
        NotUnderstood: it cannot.
    """
    what = "must never be" if goal.never else "is kept"
    begins = ("after", "from", "in") if goal.never else ("after", "from", "in", "at")
    if any(time.since not in begins or time.until for time in said.times):
        raise NotUnderstood(
            f"{said.time_words!r} says at what times something {what}, {_AS_LONG_AS_IT_STANDS}"
        )
    if said.as_long_as or goal.whenever or (goal.never and (goal.when or goal.only_if)):
        raise NotUnderstood(
            f"{said.line!r} says under what condition something {what}, {_AS_LONG_AS_IT_STANDS}"
        )


def _check_kept(said: Discourse, wanted: Iterable[Condition]) -> None:
    """Whether what is wanted can be, beside what shall always or never be so.

    Raises:
        NotUnderstood: it is the contrary of that.
    """
    for each in (c for c in wanted if not c.any_of):
        for kept in said.always:
            same = (kept.relation, kept.subject) == (each.relation, each.subject)
            if same and kept.value != each.value and each.relation not in PLACED:
                raise NotUnderstood(f"it wants {kept} always, and then {each}")
        if each in said.never:
            raise NotUnderstood(f"it wants {each}, and that never to be so")


def _asked(said: Discourse) -> list[tuple[Condition, ...]]:
    """The conditions under which a goal is wanted, each time those of one goal: of several of which
    one is enough, no two at once."""
    found, none_yet = [], list[Condition]()
    for rows in said.either or [()]:
        found.append(tuple(dict.fromkeys((*said.only_if, *none_yet, *rows))))
        none_yet += map(negation_of, rows)
    return found


def _each_apart(goal: WantedGoal) -> list[WantedGoal]:
    """ "If the windows are open, close them" is a goal for each: it closes those that are."""
    rows = goal.only_if
    kinds = {(row.relation, row.value, row.negated) for row in rows}
    wanted = [row for stage in goal.stages for row in stage]
    about = {row.subject for row in rows}
    plain = not (goal.always or goal.never or any(row.any_of for row in (*rows, *wanted)))
    if not rows[1:] or len(kinds) > 1 or goal.stages[1:] or not plain:
        return [goal]
    if len(about) != len(rows) or {row.subject for row in wanted} != about:
        return [goal]
    return [
        replace(
            goal, stages=(tuple(w for w in wanted if w.subject == row.subject),), only_if=(row,)
        )
        for row in rows
    ]


def end_goal(said: Discourse, vocabulary: Vocabulary, now: datetime | None, mode: str) -> None:
    """End the goal that was being said: other times or conditions hold for what follows.

    Raises:
        NotUnderstood: it cannot be, or a time belongs to nothing.
    """
    if (ahead := said.ahead) is not None:
        for by, draft in ahead.draft.of_each():
            goal = WantedGoal(draft.conditions(), when=ahead.when, by=by, only_if=ahead.only_if)
            said.goals.append(timed(goal, said, now))
        said.ahead = None
    wanted = [(by, draft.conditions(vocabulary.speaker)) for by, draft in said.draft.of_each()]
    if any(stages for _, stages in wanted) or said.always or said.never:
        _check_kept(said, (row for _, stages in wanted for stage in stages for row in stage))
        count = len(said.goals)
        for number, ((by, stages), only_if) in enumerate(product(wanted, _asked(said))):
            goal = WantedGoal(
                stages,
                () if number else tuple(dict.fromkeys(said.always)),
                () if number else tuple(dict.fromkeys(said.never)),
                when=tuple(dict.fromkeys(said.when)),
                by=by,
                only_if=only_if,
                whenever=tuple(dict.fromkeys(said.whenever)),
            )
            goal = timed(goal, said, now)
            goal = _otherwise(goal, said) if said.otherwise else goal
            said.goals += _each_apart(goal) if said.severally else [goal]
        if not said.otherwise:
            alternatives = [(*said.only_if, *rows) for rows in said.either or [()]]
            if len(said.goals) - count > len(wanted) * len(alternatives):  # for each of several
                alternatives = [(row,) for rows in alternatives for row in rows]
            said.asked = (*(said.asked if said.once_more else ()), *alternatives)
    elif said.times and mode == "fact":
        reason = reason_for([(token.word, token.spoken) for token in said.tokens], "a fact")
        raise NotUnderstood(reason or f"{said.line!r} names a time, which a fact cannot")
    elif said.times or said.conditions:
        what = f"{said.time_words!r} names a time" if said.times else '"If" names a condition'
        raise NotUnderstood(f"{what}, but nothing is to be done then")
    said.draft = GoalDraft(vocabulary.is_at)
    said.always, said.never, said.when, said.only_if, said.whenever = [], [], [], [], []
    said.times, said.as_long_as, said.otherwise, said.either = [], False, False, []
    said.severally = False
