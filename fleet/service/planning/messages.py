"""What the planner and its planning processes say to each other, in frames on pipes.

A frame is the length of what follows (four bytes, big-endian) and a message in msgpack. The planner
sends `Start`, the process greets with `Ready` or `Refused`; then a job goes one way and its answer
the other, one at a time.
"""

from __future__ import annotations

import struct
from typing import Any

import msgspec

from fleet.core.events import GoalInterpreted, PlanningFailed, PlanningSucceeded
from fleet.core.planning_input import InterpretationInput, PlanningInput

Job = PlanningInput | InterpretationInput
Answer = PlanningSucceeded | PlanningFailed | GoalInterpreted

HEADER = struct.Struct(">I")


class Start(msgspec.Struct, frozen=True, kw_only=True):
    """What a planning process is made with; `converses` has it start a language model's client."""

    llm_file: str | None = None
    converses: bool = False


class Ready(msgspec.Struct, frozen=True, kw_only=True, tag="ready"):
    """A planning process can take jobs, with these planners and allocators.

    Of each it is said how long it may wait for others, such as a language model, beside the time
    for planning, s; `interpreting_s` is how long paraphrasing a sentence may take.
    """

    planners_wait_s: dict[str, float]
    allocators_wait_s: dict[str, float]
    strategies: tuple[str, ...]
    interpreting_s: float

    def waiting_s(self, job: Job) -> float:
        """How long a job may wait for others, s."""
        if isinstance(job, InterpretationInput):
            return self.interpreting_s
        planner, allocator = job.job.planner, job.job.allocator
        waits_s = self.planners_wait_s.get(planner, 0.0)
        return waits_s + self.allocators_wait_s.get(allocator, 0.0)


class Refused(msgspec.Struct, frozen=True, tag="refused"):
    """A planning process cannot be made like this, for a reason to be told to people."""

    sentence: str


START: msgspec.msgpack.Decoder[Start] = msgspec.msgpack.Decoder(Start)
GREETING: msgspec.msgpack.Decoder[Ready | Refused] = msgspec.msgpack.Decoder(Ready | Refused)
JOB: msgspec.msgpack.Decoder[Job] = msgspec.msgpack.Decoder(Job)
ANSWER: msgspec.msgpack.Decoder[Answer] = msgspec.msgpack.Decoder(Answer)


def frame(message: msgspec.Struct) -> bytes:
    """A message with its length before it."""
    data = msgspec.msgpack.encode(message)
    return HEADER.pack(len(data)) + data


def failed_answer(job: Job, reason: str) -> Answer:
    """The answer to a job that came to no answer of its own."""
    at: dict[str, Any] = {"time_s": job.time_s, "wall_time_s": job.wall_time_s}
    if isinstance(job, InterpretationInput):
        return GoalInterpreted(goal=job.goal, text=job.text, reason=reason, **at)
    return PlanningFailed(job=job.job.job, reason=reason, postponed=True, **at)
