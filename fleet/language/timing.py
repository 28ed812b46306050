"""When a goal is wanted: the times that a sentence names, as those of its goal."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

from fleet.errors import NotUnderstood
from fleet.language.reading import WantedGoal
from fleet.language.resolve.discourse import Discourse


def timed(goal: WantedGoal, said: Discourse, now: datetime | None) -> WantedGoal:
    """The goal with the times that were said.

    Raises:
        NotUnderstood: a time of day was said, and what time it is now is not known.
    """
    every = next((time for time in said.times if time.kind == "every"), None)
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
