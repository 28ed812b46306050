"""Durations learned from reports: what a skill takes a type of robot, and how it gets about.

Predicted is `work + pace * way`: the skill's duration, and the way at top speed times the pace of
that type of robot. An attempt that took `r` times as long as predicted is an observation of `r *
work` and of `r * pace`; both go into running means that forget (exponentially weighted, once
`FULL_ATTEMPTS` or `FULL_WAY_S` have come in) and that begin with the skill model as one attempt.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, isfinite, sqrt

from msgspec.structs import replace

from fleet.core.model.skills import SkillModel
from keyexpr_schema.payloads.durations import Durations, Estimate
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

FULL_ATTEMPTS = 20.0
"""Attempts after which a mean forgets as fast as it learns."""
FULL_WAY_S = 300.0
"""The same for the pace, in seconds of way at top speed: about twenty drives through a home."""
ASSUMED_ATTEMPTS = 1.0
ASSUMED_WAY_S = 10.0
"""How much the skill model and the top speed count for, before anything was observed."""
SLOWEST, FASTEST = 10.0, 0.1
"""Bounds of the pace: beyond them something else than driving was measured."""


FACTOR = 2.0
MARGIN_S = 30.0
"""A task is late when it has taken this many times its predicted duration, and this long besides:
a second try, or a while at a busy door, is nothing to change a plan for."""


def late_at_s(record: TaskRecord) -> float:
    """When a task counts as late, on the fleet's clock [s]; infinity if it is not running."""
    if record.state is not TaskState.RUNNING or record.started_s is None:
        return inf
    return record.started_s + FACTOR * record.duration_s + MARGIN_S


def work_s(durations: Durations | None, skill: SkillModel) -> float:
    """What the skill takes without the way to it, s."""
    known = durations.skills.get(skill.name) if durations is not None else None
    return skill.duration_s if known is None else known.mean


def pace(durations: Durations | None) -> float:
    """How much longer a way takes than at top speed."""
    return 1.0 if durations is None or durations.pace is None else durations.pace.mean


def learn(
    known: Mapping[str, Durations],
    model: str,
    skill: SkillModel,
    took_s: float,
    way_s: float,
    time_s: float,
) -> Mapping[str, Durations]:
    """The durations with one more attempt of `skill` taken into account.

    `way_s` is its way at top speed, s. An attempt that had no way to go teaches nothing about a
    skill that only gets somewhere.
    """
    if not isfinite(took_s) or took_s < 0.0 or (way_s <= 0.0 and only_moves(skill)):
        return known
    before = known.get(model) or Durations(model=model)
    work, slow = work_s(before, skill), pace(before)
    predicted_s = work + slow * way_s
    if predicted_s <= 0.0:
        observed_s, observed_pace = took_s, slow
    else:
        ratio = took_s / predicted_s
        observed_s, observed_pace = ratio * work, min(max(ratio * slow, FASTEST), SLOWEST)
    first = Estimate(mean=skill.duration_s, weight=ASSUMED_ATTEMPTS)
    mine = _observed(before.skills.get(skill.name, first), observed_s, 1.0, FULL_ATTEMPTS)
    after = replace(before, skills={**before.skills, skill.name: mine}, time_s=time_s)
    if way_s > 0.0:
        first = Estimate(mean=1.0, weight=ASSUMED_WAY_S)
        after = replace(
            after, pace=_observed(before.pace or first, observed_pace, way_s, FULL_WAY_S)
        )
    return {**known, model: after}


def _observed(old: Estimate, value: float, weight: float, full: float) -> Estimate:
    """A weighted mean and variance with one more value (West 1979), the past cut to `full`."""
    total = min(old.weight + weight, full)
    share = min(weight / total, 1.0)
    difference = value - old.mean
    variance = (1 - share) * (old.sd**2 + share * difference**2)
    return Estimate(
        mean=old.mean + share * difference,
        sd=sqrt(variance),
        count=old.count + 1,
        weight=total,
    )


def only_moves(skill: SkillModel) -> bool:
    """Whether all that a skill does is to get its robot where it travels to."""
    return skill.moves_to is not None and skill.moves_to == skill.travel_to
