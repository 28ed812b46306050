"""The planning process: one job after the other, away from the planner's event loop.

Run by `fleet.service.planning.process`. Planners and allocators are partly others' code: what they
print goes to standard error, what they raise is an answer, and what they do to the process ends
this one only. It ends, with whatever it started, when its standard input does.
"""

from __future__ import annotations

import ctypes
import logging
import os
import resource
import signal
import sys
import threading
from pathlib import Path
from queue import SimpleQueue
from typing import BinaryIO

from fleet.core.planning_input import PlanningInput
from fleet.errors import FleetError
from fleet.service.composition import Composition, compose
from fleet.service.planning.messages import (
    HEADER,
    JOB,
    START,
    Job,
    Ready,
    Refused,
    failed_answer,
    frame,
)
from fleet.service.planning.planning_job import run_interpretation, run_planning_job
from keyexpr_schema.control_characters import show_in_logs

NICENESS = 5
"""Dispatching comes before computing a plan where both want the same core, by a factor of three."""
MEMORY_BYTES = 8 << 30
"""What the process may allocate; planning that wants more fails, and not the machine."""
_PR_SET_PDEATHSIG = 1
"""Of Linux' `prctl`: the signal that the kernel sends when the parent has died."""

log = logging.getLogger(__name__)


def main() -> None:
    """Greet, then answer jobs until standard input ends."""
    jobs, answers = _take_standard_streams()
    _limit_process()
    show_in_logs()
    logging.basicConfig(
        level=logging.INFO, stream=sys.stderr, format="%(asctime)s %(name)s: %(message)s"
    )
    frames: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_read, args=(jobs, frames), daemon=True).start()
    start = START.decode(frames.get())
    try:
        composition = compose(Path(start.llm_file) if start.llm_file is not None else None)
    except FleetError as error:
        _send(answers, frame(Refused(str(error))))
        return
    _send(answers, frame(_greeting(composition)))
    if start.converses:
        threading.Thread(target=composition.language_model.warm, daemon=True).start()
    else:
        os.nice(NICENESS)
    while True:
        _send(answers, _answer(JOB.decode(frames.get()), composition))


def _take_standard_streams() -> tuple[BinaryIO, BinaryIO]:
    """Standard input and output for frames alone: what anybody prints goes to standard error."""
    jobs = os.fdopen(os.dup(0), "rb")
    answers = os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return jobs, answers


def _send(answers: BinaryIO, data: bytes) -> None:
    answers.write(data)
    answers.flush()


def _limit_process() -> None:
    _, most = resource.getrlimit(resource.RLIMIT_DATA)
    limit = MEMORY_BYTES if most == resource.RLIM_INFINITY else min(MEMORY_BYTES, most)
    resource.setrlimit(resource.RLIMIT_DATA, (limit, most))
    if sys.platform == "linux":
        # The thread that reads cannot run while foreign code keeps the interpreter's lock.
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _read(pipe: BinaryIO, frames: SimpleQueue[bytes]) -> None:
    """Hand on every whole frame; end the process once there are no more."""
    while len(header := pipe.read(HEADER.size)) == HEADER.size:
        (size,) = HEADER.unpack(header)
        if len(data := pipe.read(size)) < size:
            break
        frames.put(data)
    if os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)  # with solvers that a job has started
    os._exit(0)


def _greeting(composition: Composition) -> Ready:
    return Ready(
        strategies=composition.strategies,
        planners_wait_s={name: each.waiting_s for name, each in composition.planners.items()},
        allocators_wait_s={name: each.waiting_s for name, each in composition.allocators.items()},
        interpreting_s=composition.paraphraser.waiting_s,
    )


def _answer(job: Job, composition: Composition) -> bytes:
    try:
        if isinstance(job, PlanningInput):
            return frame(run_planning_job(job, composition))
        return frame(run_interpretation(job, composition))
    except BaseException as error:  # whatever a stranger's planner raises, SystemExit, too
        log.exception("a planning job failed")
        said = str(error) or type(error).__name__
        return frame(failed_answer(job, f"the planner failed: {said}"))


if __name__ == "__main__":
    main()
