"""The planner's world: what is worked out once holds for every world that is alike in it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import FactKey
from keyexpr_schema.payloads.durations import Durations, Estimate
from tests.support.household import home


def test_ways_are_worked_out_once_whatever_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[object, ...]] = []
    way_s = WorldModel.way_s

    def counted(self: WorldModel, *args: str) -> float:
        asked.append(args)
        return way_s(self, *args)

    monkeypatch.setattr(WorldModel, "way_s", counted)
    world = home()
    alone = replace(world, available=frozenset({"hsr"}))
    elsewhere = world.with_facts({FactKey("at", "cup_1"): "hallway"})
    times = {one.travel_s("hsr", "kitchen", "hallway") for one in (world, elsewhere, alone)}
    assert len(times) == len(asked) == 1


def test_other_paces_are_other_ways() -> None:
    world = home()
    slow = replace(world, durations={"hsr": Durations(model="hsr", pace=Estimate(mean=2.0))})
    fast_s = world.travel_s("hsr", "kitchen", "hallway")
    assert slow.travel_s("hsr", "kitchen", "hallway") == 2 * fast_s
    assert world.travel_s("hsr", "kitchen", "hallway") == fast_s
    fewer = replace(world, objects={})
    assert world.of_type("cup") and fewer.of_type("cup") == ()
