"""What a worker says is no longer so is as old as what was thought."""

from __future__ import annotations

import pytest

from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.world import Fact
from sim.files.mission_file import load_mission
from sim.server.process import make_backend
from tests.support.worker_world import BackendBody, LiveWorld
from workers.skill_context import SkillContext
from workers.world_cache import WorldCache


@pytest.mark.parametrize(("thought_s", "said_s"), [(2.0, 2.0), (None, 8.0), (9.0, 8.0), (0.0, 8.0)])
def test_that_a_thing_is_not_where_it_was_thought_says_nothing_against_who_has_seen_it_since(
    thought_s: float | None, said_s: float
) -> None:
    backend = make_backend(load_mission("two-cups"), "kinematic")
    backend.time_s = 8.0
    cache = WorldCache()
    if thought_s is not None:
        known = Fact(relation=AT, subject="cup_1", value="hsr", source="ana", time_s=thought_s)
        cache.facts[known.key] = known
    spec = load_mission("two-cups").robots[0].spec
    context = SkillContext(spec, BackendBody(LiveWorld(backend), spec.robot), cache)
    context.observe(AT, "cup_1", None)
    (gone,) = context.observed
    assert (gone.value, gone.time_s) == (None, said_s)
    # What it has seen itself in this attempt is newer.
    context.observe(AT, "cup_1", "kitchen")
    context.observe(AT, "cup_1", None)
    assert context.observed[0].time_s == 8.0
