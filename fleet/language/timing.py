"""Goals as their sentences end, and when they are wanted: the times that a sentence names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from datetime import datetime

from fleet.errors import NotUnderstood
from fleet.language.reading import WantedGoal
from fleet.language.refusals import reason_for
from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.stages import PLACED, GoalDraft
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.payloads.goals import Condition


def timed(goal: WantedGoal, said: Discourse, now: datetime | None) -> WantedGoal:
    """The goal with the times that were said.

    Raises:
        NotUnderstood: a time of day was said, and what time it is now is not known.
    """
    every = next((time for time in said.times if time.kind == "every"), None)
    kinds = [time.kind for time in said.times]
    if any(kinds.count(kind) > 1 for kind in kinds):
        raise NotUnderstood(f"{said.time_words!r} are two times for one thing: say one each")
    for time in said.times:
        if time is every:
            at = next((t for t in said.times if t.kind == "start" and t.hour is not None), None)
            if at is not None and time.every_s is None:
                time = replace(time, hour=at.hour, minute=at.minute)
            goal = replace(goal, every=time.recurrence)
            continue
        if every is not None and time.kind == "start" and time.hour is not None:
            continue
        if time.after_s is None and now is None:
            raise NotUnderstood("a time of day is named, and what time it is now is not known")
        seconds = time.after_s if now is None or time.after_s is not None else time.seconds(now)
        if time.until is not None and now is not None:
            end = replace(time, hour=time.until[0], minute=time.until[1])
            goal = replace(goal, due_s=end.seconds(now))
        if time.kind == "due" or (time.hour is not None and not said.done):
            goal = replace(goal, due_s=seconds)
        else:
            goal = replace(goal, not_before_s=seconds)
    return goal


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


def end_goal(said: Discourse, vocabulary: Vocabulary, now: datetime | None, mode: str) -> None:
    """End the goal that was being said: other times or conditions hold for what follows.

    Raises:
        NotUnderstood: it cannot be, or a time belongs to nothing.
    """
    wanted = [(by, draft.conditions(vocabulary.speaker)) for by, draft in said.draft.of_each()]
    if any(stages for _, stages in wanted) or said.always or said.never:
        _check_kept(said, (row for _, stages in wanted for stage in stages for row in stage))
        for number, (by, stages) in enumerate(wanted):
            goal = WantedGoal(
                stages,
                () if number else tuple(dict.fromkeys(said.always)),
                () if number else tuple(dict.fromkeys(said.never)),
                when=tuple(dict.fromkeys(said.when)),
                by=by,
                only_if=tuple(dict.fromkeys(said.only_if)),
            )
            said.goals.append(timed(goal, said, now))
    elif said.times and mode == "fact":
        reason = reason_for([(token.word, token.spoken) for token in said.tokens], "a fact")
        raise NotUnderstood(reason or f"{said.line!r} names a time, which a fact cannot")
    elif said.times or said.when or said.only_if:
        what = f"{said.time_words!r} names a time" if said.times else '"If" names a condition'
        raise NotUnderstood(f"{what}, but nothing is to be done then")
    said.draft = GoalDraft(vocabulary.is_at)
    said.always, said.never, said.when, said.only_if = [], [], [], []
    said.times = []
