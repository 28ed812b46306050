"""The planner's planning processes: who does which job when, and an answer to each.

There are two lanes. Jobs that compute go one after the other, the most urgent first, since more
would only take the cores from each other and from dispatching; what is more urgent than the one
that goes on begins beside it. Jobs that wait for a language model go on side by side.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from pathlib import Path
from typing import Any

import msgspec

from fleet.core.planning_input import PlanningInput
from fleet.errors import FleetError
from fleet.service.planning.messages import Answer, Job, Ready, Start, failed_answer
from fleet.service.planning.process import (
    PlanningProcess,
    PlanningProcessEnded,
    PlanningTookTooLong,
)
from keyexpr_schema.private_files import private_folder, write_private

COMPUTING = 3
"""As many as there are urgencies; the second and third are started when they are needed."""
CONVERSATIONS = 4
"""Jobs that may wait for a language model at the same time."""
TRIES = 2
"""A process that ended over a job may have been killed from outside; twice is the job's doing."""
GRACE_S = 10.0
"""What paraphrasing a sentence may take besides waiting for the language model, s."""
KEPT_FAILURES = 5
"""Inputs of jobs that ended their process, kept for whoever looks into it."""

_Key = int | tuple[str, str]
"""The number of a planning job, or a goal and the sentence of it that is read."""

log = logging.getLogger(__name__)


@dataclass(eq=False)
class _Ticket:
    """A job that is waited for."""

    job: Job
    process: PlanningProcess | None = None

    @property
    def key(self) -> _Key:
        job = self.job
        return job.job.job if isinstance(job, PlanningInput) else (job.goal, job.text)


@dataclass(eq=False)
class _Lane:
    """Processes that are free, the one used last on top, and tickets by urgency.

    Where they do not go `side_by_side`, one begins only if it is more urgent than all `running`.
    """

    idle: list[PlanningProcess]
    side_by_side: bool = False
    running: list[int] = field(default_factory=list)
    waiting: list[tuple[int, int, _Ticket]] = field(default_factory=list)


class PlanningPool:
    """Does planning jobs in processes of their own. Each answer is put into `answers`, once."""

    def __init__(self, llm_file: Path | None = None, failures: Path | None = None) -> None:
        """`llm_file` is that of `compose`; inputs of failed jobs are kept in `failures`."""
        llm = None if llm_file is None else str(llm_file)
        how = Start(llm_file=llm, converses=True)
        talking = [PlanningProcess(how) for _ in range(CONVERSATIONS)]
        computing = [PlanningProcess(Start(llm_file=llm)) for _ in range(COMPUTING)]
        self._computing = _Lane(computing)
        self._conversing = _Lane(talking, side_by_side=True)
        self._processes = [*computing, *talking]
        self._first = computing[-1]
        self._failures = failures
        self._ready: Ready | None = None
        self._tickets: dict[_Key, _Ticket] = {}
        self._numbers = count()
        self._tasks: set[asyncio.Task[None]] = set()
        self.answers: asyncio.Queue[Answer] = asyncio.Queue()

    @asynccontextmanager
    async def running(self) -> AsyncIterator[PlanningPool]:
        """Take jobs until the block ends; jobs without an answer then have none."""
        self._spawn(self._warm_up())
        try:
            yield self
        finally:
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
            for process in self._processes:
                await process.close()

    async def ready(self) -> Ready:
        """What planners and allocators there are, as soon as a process knows.

        Raises:
            PlanningProcessEnded: none can be started; the message says why.
        """
        if self._ready is None:
            self._ready = await self._first.started()
        return self._ready

    def submit(self, job: Job) -> None:
        """Have a job done; one that is waited for already is not done twice."""
        ticket = _Ticket(job)
        if ticket.key in self._tickets:
            return
        self._tickets[ticket.key] = ticket
        lane = self._conversing if self._waiting_s(job) else self._computing
        heappush(lane.waiting, (_urgency(job), next(self._numbers), ticket))
        self._assign(lane)

    def drop(self, job: int) -> None:
        """Nobody waits for this planning job any more: it is not begun, or its process is ended."""
        ticket = self._tickets.pop(job, None)
        if ticket is not None and ticket.process is not None:
            ticket.process.kill()

    def _assign(self, lane: _Lane) -> None:
        while lane.idle and lane.waiting:
            urgency, _, ticket = lane.waiting[0]
            if self._tickets.get(ticket.key) is ticket:
                if not lane.side_by_side and any(urgency >= other for other in lane.running):
                    return
                ticket.process = lane.idle.pop()
                lane.running.append(urgency)
                self._spawn(self._serve(lane, ticket, ticket.process))
            heappop(lane.waiting)

    async def _serve(self, lane: _Lane, ticket: _Ticket, process: PlanningProcess) -> None:
        answer = await self._answer_to(ticket, process)
        ticket.process = None
        lane.running.remove(_urgency(ticket.job))
        if self._tickets.get(ticket.key) is ticket:
            del self._tickets[ticket.key]
            self.answers.put_nowait(answer)
        lane.idle.append(process)
        self._assign(lane)
        if process in lane.idle:
            with suppress(PlanningProcessEnded):  # the next job is told if it still cannot
                await process.started()

    async def _answer_to(self, ticket: _Ticket, process: PlanningProcess) -> Answer:
        job = ticket.job
        reason = ""
        for _ in range(TRIES):
            try:
                return await process.answer(job, self._limit_s(job))
            except FleetError as error:
                reason = str(error)
                if self._tickets.get(ticket.key) is not ticket:
                    break
                log.warning("planning job %s: %s", ticket.key, reason)
                await asyncio.to_thread(self._keep, ticket)
                if isinstance(error, PlanningTookTooLong):
                    break
            except Exception as error:  # every job has an answer
                log.exception("planning job %s", ticket.key)
                reason = f"it cannot be given to a planning process: {error}"
                break
        return failed_answer(job, reason)

    def _waiting_s(self, job: Job) -> float:
        return 0.0 if self._ready is None else self._ready.waiting_s(job)

    def _limit_s(self, job: Job) -> float:
        own_s = job.limit_s if isinstance(job, PlanningInput) else GRACE_S
        return own_s + self._waiting_s(job)

    def _keep(self, ticket: _Ticket) -> None:
        """Keep the input of a job that failed, and only those of the last few."""
        if self._failures is None:
            return
        with suppress(OSError):
            private_folder(self._failures)
            job = ticket.job
            name = f"job-{job.job.job}" if isinstance(job, PlanningInput) else f"goal-{job.goal}"
            path = self._failures / f"{name}.json"
            write_private(path, msgspec.json.encode(ticket.job))
            log.warning("what it was to plan is kept in %s", path)
            kept = sorted(self._failures.glob("*.json"), key=lambda each: each.stat().st_mtime)
            for old in kept[:-KEPT_FAILURES]:
                old.unlink()

    async def _warm_up(self) -> None:
        """Start what will be needed, before it is."""
        with suppress(PlanningProcessEnded):  # `ready` tells
            ready = await self.ready()
            if ready.interpreting_s:
                await self._conversing.idle[-1].started()

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _urgency(job: Job) -> int:
    """A running plan waits for its next revision; nobody waits for a dry run but a person.

    The least number comes first.
    """
    if not isinstance(job, PlanningInput):
        return 1
    if job.job.dry_run:
        return 2
    return 0 if job.job.reason is not None else 1
