"""What one plan has and another has not: pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from keyexpr_schema.ids import actor_in
from keyexpr_schema.payloads.plans import Plan, Task


class PlanSide(msgspec.Struct, frozen=True, kw_only=True):
    """One of two plans: `name` is how it was asked for, `allocation` may be empty (not known)."""

    name: str
    plan: Plan
    allocation: dict[str, str] = {}

    def robot(self, actor: str) -> str | None:
        """The robot that is an actor, as far as that is known."""
        return self.allocation.get(actor) or self.plan.pins.get(actor)


class FieldChange(msgspec.Struct, frozen=True, kw_only=True):
    """One thing about a task: `skill`, `robot`, `after`, or `args.NAME`; in words on each side."""

    field: str
    before: str
    now: str


class TaskChange(msgspec.Struct, frozen=True, kw_only=True):
    """A task of both plans; `was` is its name in the first."""

    task: str
    was: str
    changes: tuple[FieldChange, ...] = ()


class PlanDiff(msgspec.Struct, frozen=True, kw_only=True):
    """From plan `a` to plan `b`. `finished` are tasks of `a` that are done: `b` needs no such."""

    a: str
    b: str
    kept: tuple[TaskChange, ...]
    changed: tuple[TaskChange, ...]
    dropped: tuple[Task, ...]
    added: tuple[Task, ...]
    finished: tuple[Task, ...]
    goals_dropped: tuple[str, ...] = ()
    goals_added: tuple[str, ...] = ()


def compare(a: PlanSide, b: PlanSide, finished: Iterable[str] = ()) -> PlanDiff:
    """How `b` differs from `a`; `finished` names tasks of `a` that have succeeded meanwhile.

    A task is the same in both if its name and skill are; else if it is the same call (skill and
    arguments, robots aside); else if only its name is. Actors are compared as the robots that they
    are, and where that is not known, not at all: their names mean nothing outside their plan.
    """
    done = set(finished) - {task.task for task in b.plan.tasks}
    ours = [task for task in a.plan.tasks if task.task not in done]
    pairs = _pairs(ours, b.plan.tasks)
    names = {was.task: now.task for was, now in pairs}
    both = [
        TaskChange(task=now.task, was=was.task, changes=_changes(a, b, was, now, names, done))
        for was, now in pairs
    ]
    matched = {now.task for _, now in pairs}
    return PlanDiff(
        a=a.name,
        b=b.name,
        kept=tuple(each for each in both if not each.changes),
        changed=tuple(each for each in both if each.changes),
        dropped=tuple(task for task in ours if task.task not in names),
        added=tuple(task for task in b.plan.tasks if task.task not in matched),
        finished=tuple(task for task in a.plan.tasks if task.task in done),
        goals_dropped=tuple(goal for goal in a.plan.goals if goal not in b.plan.goals),
        goals_added=tuple(goal for goal in b.plan.goals if goal not in a.plan.goals),
    )


def _pairs(ours: Iterable[Task], theirs: Iterable[Task]) -> list[tuple[Task, Task]]:
    """Tasks that are the same, in the order of `theirs`."""
    left = list(ours)
    found: dict[str, tuple[Task, Task]] = {}
    theirs = list(theirs)

    def match(same: Mapping[str, object], of: Mapping[str, object]) -> None:
        for now in theirs:
            if now.task in found:
                continue
            was = next((each for each in left if of[each.task] == same[now.task]), None)
            if was is not None:
                left.remove(was)
                found[now.task] = (was, now)

    for key in (_name_and_skill, _call, _name):
        match({t.task: key(t) for t in theirs}, {t.task: key(t) for t in left})
    return [found[task.task] for task in theirs if task.task in found]


def _name_and_skill(task: Task) -> object:
    return task.task, task.skill


def _call(task: Task) -> object:
    return task.skill, tuple(
        sorted((n, v if actor_in(v) is None else "?") for n, v in task.args.items())
    )


def _name(task: Task) -> object:
    return task.task


def _changes(
    a: PlanSide,
    b: PlanSide,
    was: Task,
    now: Task,
    names: Mapping[str, str],
    done: set[str],
) -> tuple[FieldChange, ...]:
    changes = []

    def differs(field: str, before: str, after: str) -> None:
        if before != after:
            changes.append(FieldChange(field=field, before=before, now=after))

    differs("skill", was.skill, now.skill)
    for name in dict.fromkeys([*was.args, *now.args]):
        before, after = _argument(a, was, name), _argument(b, now, name)
        if before is not None and after is not None:
            differs(f"args.{name}", before, after)
    robots = a.robot(was.actor), b.robot(now.actor)
    if None not in robots:
        differs("robot", robots[0] or "", robots[1] or "")
    # What is done need not be waited for; that is no change of the plan.
    waited = sorted(names.get(task, task) for task in was.after if task not in done)
    differs("after", ", ".join(waited) or "nothing", ", ".join(sorted(now.after)) or "nothing")
    return tuple(changes)


def _argument(side: PlanSide, task: Task, name: str) -> str | None:
    """An argument in words; `None` where it says what the robot says, or cannot be compared."""
    value = task.args.get(name, "nothing")
    actor = actor_in(value)
    if actor is None:
        return value
    return None if actor == task.actor else side.robot(actor)
