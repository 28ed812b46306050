"""What the suite of missions is run with in tests, so that a run is the same each time."""

from __future__ import annotations

from dataclasses import replace

from fleet.allocators.makespan import MakespanAllocator
from fleet.jobshop.time_budget import StepClock
from fleet.service.composition import Composition, compose

_ALL = compose()
PARTS: Composition = replace(
    _ALL,
    allocators={
        **_ALL.allocators,
        # What is searched for as long as there is time would differ from run to run.
        "makespan": MakespanAllocator(deadline_s=0.2, exact=False, clock=StepClock()),
    },
)
