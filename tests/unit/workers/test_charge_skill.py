"""The skill `charge`, in the world without physics."""

from __future__ import annotations

import asyncio
from typing import Any

import msgspec
import pytest

from keyexpr_schema.facts import Value
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.robots import Battery
from sim.files.mission_file import load_mission
from sim.files.world_payloads import object_payloads, place_payloads
from sim.server.process import make_backend
from tests.support.worker_world import BackendBody, LiveWorld
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skills.charge import charge
from workers.world_cache import WorldCache

SMALL = Battery(capacity_wh=10, idle_w=10, driving_w=60, working_w=40, charging_w=600)


def charged(battery: Battery | None, percent: float) -> tuple[dict[str, Value], list[MotionKind]]:
    """What hsr observed, and the motions that it did."""
    loaded = load_mission("two-cups")
    robot = loaded.robots[0]
    spec = msgspec.structs.replace(robot.spec, battery=battery)
    robot = msgspec.structs.replace(robot, spec=spec, charge=percent)
    backend = make_backend(msgspec.structs.replace(loaded, robots=(robot,)), "kinematic")
    live, cache = LiveWorld(backend), WorldCache()
    cache.places = {place.place: place for place in place_payloads(loaded.world)}
    cache.objects = {thing.object: thing for thing in object_payloads(loaded.world)}
    cache.specs = {spec.robot: spec}
    context = SkillContext(spec, BackendBody(live, spec.robot), cache)

    async def go() -> None:
        running = asyncio.create_task(live.run())
        try:
            await charge(context, charger="charger", place="hallway")
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(go())
    observed: dict[str, Any] = {str(fact.key): fact.value for fact in context.observed}
    return observed, [motion.kind for _, motion in live.begun]


def test_it_docks_until_the_battery_is_full_and_leaves_the_charger_to_others() -> None:
    observed, motions = charged(SMALL, 30.0)
    assert observed == {"at(hsr)": "hallway", "charge(hsr)": 100}
    assert motions == [MotionKind.GO_TO, MotionKind.CHARGE, MotionKind.GO_TO]


def test_a_full_battery_is_not_charged() -> None:
    assert charged(SMALL, 99.5) == ({"charge(hsr)": 100}, [])


def test_who_has_no_battery_cannot() -> None:
    with pytest.raises(SkillFailed, match="hsr has no battery to charge") as failed:
        charged(None, 100.0)
    assert not failed.value.retryable
