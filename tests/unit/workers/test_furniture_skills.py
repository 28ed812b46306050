"""The household skills at furniture and with people, in the world without physics."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.facts import FactKey, Value
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.world import Fact
from sim.files.world_payloads import object_payloads, place_payloads
from sim.kinematic.backend import KinematicBackend, MotionModel
from tests.support.furnished import furnished, hsr
from tests.support.worker_world import BackendBody, LiveWorld
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import SkillRegistry
from workers.skills.household import HOUSEHOLD
from workers.world_cache import WorldCache

SKILLS = SkillRegistry(HOUSEHOLD)


class Household:
    """One robot in the flat, and what is known of it."""

    def __init__(self, backend: KinematicBackend, live: LiveWorld) -> None:
        self.backend, self._live = backend, live
        self.cache = WorldCache()
        self.cache.places = {place.place: place for place in place_payloads(backend.world)}
        self.cache.objects = {thing.object: thing for thing in object_payloads(backend.world)}
        self.spec, _ = hsr()
        self.cache.specs = {self.spec.robot: self.spec}

    def believe(self, relation: str, subject: str, value: Value) -> None:
        self.cache.facts[FactKey(relation, subject)] = Fact(
            relation=relation, subject=subject, value=value, source="test"
        )

    async def do(self, skill: str, /, **arguments: str) -> dict[str, Value]:
        """Carry out a skill; what it observed becomes known."""
        context = SkillContext(self.spec, BackendBody(self._live, "hsr"), self.cache)
        found = SKILLS.get(skill, [one.name for one in HOUSEHOLD])
        bound = found.bind(arguments, "hsr", self.cache)
        try:
            await found(context, **bound)
        finally:
            for fact in context.observed:
                self.cache.facts[fact.key] = fact
        return {str(fact.key): fact.value for fact in context.observed}

    def support(self, name: str) -> str | None:
        return next(t.support for t in self.backend.truths() if t.object == name)


@asynccontextmanager
async def household(folder: Path, **options: Any) -> AsyncIterator[Household]:
    backend = KinematicBackend(furnished(folder), [hsr()], MotionModel(**options), step_s=0.5)
    live = LiveWorld(backend)
    running = asyncio.create_task(live.run())
    try:
        yield Household(backend, live)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


def run(folder: Path, script: Callable[[Household], Awaitable[None]], **options: Any) -> None:
    async def go() -> None:
        async with household(folder, **options) as home:
            await script(home)

    asyncio.run(go())


def test_a_cup_is_fetched_from_a_cupboard_into_a_bowl(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        home.believe("at", "cup_1", "cupboard")
        with pytest.raises(SkillFailed, match="in cupboard, which is closed"):
            await home.do("pick", object="cup_1", place="kitchen")
        assert home.cache.value_of("at", "cup_1") == "cupboard"
        seen = await home.do("open", thing="cupboard", place="kitchen")
        assert seen["is_open(cupboard)"] is True
        picked = await home.do("pick", object="cup_1", place="kitchen")
        assert picked["at(cup_1)"] == "hsr"
        put = await home.do("place_in", object="cup_1", into="bowl_1", place="kitchen")
        assert (put["holding(hsr)"], put["at(cup_1)"]) == ("nothing", "bowl_1")
        assert home.support("cup_1") == "bowl_1"
        closed = await home.do("close", thing="cupboard", place="kitchen")
        assert closed["is_open(cupboard)"] is False

    run(tmp_path, script)


def test_what_nobody_knew_of_is_seen_in_an_open_cupboard(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        found = await home.do("search", place="kitchen")
        assert "at(cup_1)" not in found
        assert found["is_open(dresser_drawer_1)"] is False
        assert "at(cupboard)" not in found, "where furniture stands is no news"
        await home.do("open", thing="cupboard", place="kitchen")
        inside = await home.do("look_into", container="cupboard", place="kitchen")
        assert inside["at(cup_1)"] == "cupboard"

    run(tmp_path, script)


def test_a_search_does_not_doubt_what_is_in_something_closed(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        home.believe("at", "spoon_1", "dresser_drawer_1")
        home.believe("at", "cup_1", "kitchen")
        found = await home.do("search", place="kitchen")
        assert "at(spoon_1)" not in found
        assert found["at(cup_1)"] is None

    run(tmp_path, script)


def test_looking_into_a_thing_tells_what_is_in_it_and_what_is_not(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        home.believe("at", "mug_1", "cupboard")
        with pytest.raises(SkillFailed, match="cupboard is closed"):
            await home.do("look_into", container="cupboard", place="kitchen")
        await home.do("open", thing="cupboard", place="kitchen")
        home.believe("at", "mug_1", "cupboard")
        home.believe("at", "cup_1", None)
        found = await home.do("look_into", container="cupboard", place="kitchen")
        assert found["at(cup_1)"] == "cupboard"
        assert found["at(mug_1)"] != "cupboard"
        assert found["searched(cupboard)"] is True

    run(tmp_path, script)


def test_a_person_gets_a_mug_and_the_lamp_is_switched(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        await home.do("pick", object="mug_1", place="kitchen")
        with pytest.raises(SkillFailed, match="no hand free"):
            await home.do("switch_on", thing="lamp", place="hall")
        given = await home.do("hand_over", object="mug_1", person="anna", place="hall")
        assert given["at(mug_1)"] == "anna"
        assert home.support("mug_1") == "anna"
        assert (await home.do("switch_on", thing="lamp", place="hall"))["is_on(lamp)"] is True
        assert (await home.do("switch_off", thing="lamp", place="hall"))["is_on(lamp)"] is False

    run(tmp_path, script)


def test_a_closed_drawer_takes_nothing_and_says_so_for_good(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        await home.do("pick", object="mug_1", place="kitchen")
        with pytest.raises(SkillFailed, match="dresser_drawer_2 is closed") as failed:
            await home.do("place_in", object="mug_1", into="dresser_drawer_2", place="kitchen")
        assert not failed.value.retryable
        await home.do("place_on", object="mug_1", onto="bookcase_board_1", place="hall")
        assert home.support("mug_1") == "bookcase_board_1"

    run(tmp_path, script)


def test_a_hand_that_slips_off_a_handle_is_a_failure_that_can_be_tried_again(
    tmp_path: Path,
) -> None:
    async def script(home: Household) -> None:
        with pytest.raises(SkillFailed, match="slipped out of the hand") as failed:
            await home.do("open", thing="cupboard", place="kitchen")
        assert failed.value.retryable
        await home.do("open", thing="cupboard", place="kitchen")

    run(tmp_path, script, failures={"hsr": {MotionKind.OPEN.value: (1,)}})


def test_what_is_open_and_in_the_way_becomes_known(tmp_path: Path) -> None:
    async def script(home: Household) -> None:
        await home.do("open", thing="dresser_drawer_1", place="kitchen")
        home.cache.facts.clear()
        with pytest.raises(SkillFailed, match="is in the way") as caught:
            await home.do("open", thing="dresser_drawer_2", place="kitchen")
        assert not caught.value.retryable
        assert set(caught.value.facts) == {
            ("blocked_by", "dresser_drawer_2", "dresser_drawer_1"),
            ("is_open", "dresser_drawer_1", True),
        }

    run(tmp_path, script)
