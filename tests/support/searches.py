"""How long searches for schedules may go on in tests."""

from __future__ import annotations

from fleet.jobshop.time_budget import StepClock, TimeBudget

NEVER_S = 600.0
"""A search that has not ended by itself by then never will: it takes seconds."""


def steps(seconds: float) -> TimeBudget:
    """The same number of iterations on every machine."""
    return TimeBudget(seconds, StepClock())
