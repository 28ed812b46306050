"""What is missing first where a goal is out of reach: the sentence for it."""

from __future__ import annotations

from fleet.planners.symbolic.finite_domain import FiniteDomainTask
from fleet.planners.symbolic.grounding import Grounding


def what_is_missing(grounding: Grounding, task: FiniteDomainTask) -> str:
    """A sentence."""
    return f"no sequence of skills leads to {task.goal[0]}"
