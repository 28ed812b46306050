"""Where a plan comes from that a person names: a file, the key-space, or the store's journal."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from cli.errors import Unknown, check_known
from cli.plans.comparison import PlanSide
from cli.plans.files import is_plan_file, read_plan
from keyexpr_schema.decoding import decode
from keyexpr_schema.errors import SchemaError
from keyexpr_schema.keyspace import PLAN_SPEC, PLAN_STATUS, STORE_JOURNAL, TASK_RECORD
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanStatus
from keyexpr_schema.payloads.system import JournalEntry, StoreAddress, StoreJournal, StoreQuery
from keyexpr_schema.payloads.tasks import TaskState

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

PAGE = 1000
"""Entries of the journal asked for at once."""
JOURNAL_S = 10.0


def revision_of(name: str) -> tuple[str, int | None]:
    """`plan-1@2` as `("plan-1", 2)`; without `@` and a number the revision is `None`.

    Raises:
        Unknown: what follows the `@` is no revision.
    """
    plan, at, number = name.partition("@")
    if not at:
        return name, None
    if not number.isdecimal() or int(number) < 1:
        raise Unknown(f"{name!r}: {number!r} is no revision; write PLAN@1, PLAN@2, …")
    return plan, int(number)


async def plan_named(session: Session, name: str) -> PlanSide:
    """The plan of that name; an earlier revision of it as the store's journal has it.

    Raises:
        Unknown: there is no such plan, or no such revision; the message lists those there are.
        NoReply: the store has no journal (a zenohd storage has none).
    """
    plan, revision = revision_of(name)
    specs = {address.plan: spec for address, spec in (await session.list(PLAN_SPEC)).items()}
    if revision is None:
        check_known("plan", plan, specs)
    if plan in specs and revision in (None, specs[plan].revision):
        status = await session.get(PLAN_STATUS, PlanAddress(plan))
        return PlanSide(name=name, plan=specs[plan], allocation=status.allocation if status else {})
    assert revision is not None
    past = await _history(session, PlanAddress(plan))
    if not past and plan not in specs:
        check_known("plan", plan, specs)
    if revision not in past:
        known = sorted({*past, *((specs[plan].revision,) if plan in specs else ())})
        raise Unknown(
            f"plan {plan} has no revision {revision}; known are: {', '.join(map(str, known))}"
        )
    return msgspec.structs.replace(past[revision], name=name)


async def finished_tasks(session: Session, plan: str) -> list[str]:
    """The tasks of a plan, of whatever revision, that have succeeded."""
    return [
        address.task
        for address, record in (await session.list(TASK_RECORD, plan=plan)).items()
        if record.state is TaskState.SUCCEEDED
    ]


def plan_in_file(name: str) -> PlanSide | None:
    """The plan in a file, if `name` is a file's."""
    return PlanSide(name=name, plan=read_plan(Path(name))) if is_plan_file(name) else None


async def _history(session: Session, address: PlanAddress) -> dict[int, PlanSide]:
    """Every revision of a plan that the journal remembers, with its allocation."""
    spec_key, status_key = PLAN_SPEC.build(address), PLAN_STATUS.build(address)
    plans: dict[int, Plan] = {}
    allocations: dict[int, dict[str, str]] = {}
    async for entry in _journal(session, f"plans/{address.plan}/*"):
        if entry.value is None or entry.keyexpr not in (spec_key, status_key):
            continue
        try:
            if entry.keyexpr == spec_key:
                plan = decode(entry.value, Plan)
                plans[plan.revision] = plan
            else:
                status = decode(entry.value, PlanStatus)
                allocations[status.revision] = status.allocation
        except (msgspec.DecodeError, SchemaError):
            continue  # somebody put nonsense there; the planner has put the right one after it
    return {
        revision: PlanSide(
            name=f"{address.plan}@{revision}",
            plan=plan,
            allocation=allocations.get(revision, {}),
        )
        for revision, plan in plans.items()
    }


async def _journal(session: Session, pattern: str) -> AsyncIterator[JournalEntry]:
    after = 0
    while True:
        # What a query key replies is not in its type; the key table says it is a StoreJournal.
        query = StoreQuery(after=after, limit=PAGE, pattern=pattern)
        page: StoreJournal = await session.query(STORE_JOURNAL, StoreAddress(), query, JOURNAL_S)
        for entry in page.entries:
            yield entry
        if not page.entries:
            return
        after = page.entries[-1].number
