"""How what is derived from the state as a whole follows the changes of one plan."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from fleet.core.indexes.fleet_index import (
    NO_ORDERS,
    FleetIndex,
    in_set,
    job_of,
    priority_of,
    requests_of,
)
from fleet.core.indexes.plan_index import robots_of
from fleet.core.plan_entry import PlanEntry
from fleet.core.table import Table
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.tasks import TaskRecord


def entry_changed(
    index: FleetIndex,
    name: str,
    old: PlanEntry | None,
    new: PlanEntry | None,
    goals: Mapping[str, Goal],
) -> FleetIndex:
    """The index after the entry of a plan was `old` and is `new`."""
    was = old.wanted_goals if old is not None and not old.ended else ()
    now = new.wanted_goals if new is not None and not new.ended else ()
    if was is not now:
        plans_of = index.plans_of
        for goal in set(was) ^ set(now):
            rest = tuple(plan for plan in plans_of.get(goal, ()) if plan != name)
            plans = (*rest, name) if goal in now else rest
            plans_of = plans_of.set(goal, plans) if plans else plans_of.delete(goal)
        index = replace(index, plans_of=plans_of)
    if new is None or new.ended:
        index = replace(index, active=index.active.without(name))
    elif was is not now or name not in index.active:
        index = replace(index, active=index.active.set(name, priority_of(new, goals)))
    index = _job_changed(index, name, old, new)
    before = old.index.outstanding if old is not None else Table()
    after = new.index.outstanding if new is not None else Table()
    if before is after:
        return index
    for task in before:
        if task not in after:
            assert old is not None
            index = order_changed(index, old.records[task], False)
    for task in after:
        if task not in before:
            assert new is not None
            index = order_changed(index, new.records[task], True)
    return index


def _job_changed(
    index: FleetIndex, name: str, old: PlanEntry | None, new: PlanEntry | None
) -> FleetIndex:
    """The index after what is in work for a plan, or what the plan does without, changed."""
    was, now = job_of(old), job_of(new)
    if was != now:
        jobs = index.job_of
        if was is not None:
            jobs = jobs.delete(was)
        if now is not None:
            jobs = jobs.set(now, name)
        index = replace(index, job_of=jobs)
    before, after = requests_of(old), requests_of(new)
    if before != after:
        asked = index.asked
        for request in before ^ after:
            asked = in_set(asked, request, name, request in after)
        index = replace(index, asked=asked)
    drops = new is not None and bool(new.unwanted)
    if drops != (name in index.dropping):
        dropping = index.dropping
        dropping = dropping.set(name, None) if drops else dropping.delete(name)
        index = replace(index, dropping=dropping)
    return index


def order_changed(index: FleetIndex, record: TaskRecord, there: bool) -> FleetIndex:
    """The index after a task came to be in work, or no longer is."""
    work, order = index.work, (record.plan, record.task)
    for robot in robots_of(record):
        orders = work.get(robot)
        if there:
            work = work.set(robot, (orders or NO_ORDERS).set(order, None))
        elif orders is not None and order in orders:
            rest = orders.delete(order)
            work = work.set(robot, rest) if rest else work.delete(robot)
    return replace(index, work=work)
