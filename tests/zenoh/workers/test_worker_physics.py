"""Every household skill in the physical world, judged by where things really are."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from keyexpr_schema.payloads.tasks import Report, ReportState
from keyexpr_schema.transport.session import SessionConfig
from sim.backend import Backend
from sim.files.mission_file import Mission
from sim.mujoco_world import MujocoBackend
from tests.support.worker_world import Fleet, running_fleet


def physics(mission: Mission) -> Backend:
    return MujocoBackend(mission.world, [(r.spec, r.start_m_rad) for r in mission.robots])


def truth(fleet: Fleet, name: str) -> tuple[str | None, str | None, str | None]:
    """`(place, support, held_by)` of an object, as it really is."""
    found = next(t for t in fleet.world.backend.truths() if t.object == name)
    return found.place, found.support, found.held_by


def told(report: Report) -> dict[tuple[str, str], object]:
    return {(f.relation, f.subject): f.value for f in report.facts}


@pytest.mark.slow
async def test_both_cups_go_where_they_shall_by_hand_and_by_basket(
    session_config: Callable[..., SessionConfig], tmp_path: Path
) -> None:
    async with (
        running_fleet(session_config, tmp_path / "workers", physics) as fleet,
        fleet.worker("hsr"),
        fleet.worker("locobot"),
    ):
        count = 0

        async def do(robot: str, skill: str, **args: str) -> Report:
            nonlocal count
            count += 1
            report = await fleet.report(await fleet.order(robot, f"t{count}", skill, **args))
            assert report.state is ReportState.SUCCEEDED, f"{skill} {args}: {report.reason}"
            return report

        searched = told(await do("hsr", "search", place="kitchen"))
        assert searched["at", "cup_1"] == searched["at", "cup_2"] == "kitchen_table"
        await do("locobot", "navigate", to="kitchen")
        await do("hsr", "pick", object="cup_1", place="kitchen")
        assert truth(fleet, "cup_1")[2] == "hsr"
        await do("hsr", "place_on_robot", object="cup_1", carrier="locobot", place="kitchen")
        assert truth(fleet, "cup_1")[1] == "locobot"
        await do("locobot", "navigate", to="hallway")
        assert truth(fleet, "cup_1")[:2] == ("hallway", "locobot")
        await do("hsr", "pick", object="cup_2", place="kitchen")
        await do("hsr", "place", object="cup_2", place="living_room")
        assert truth(fleet, "cup_2") == ("living_room", "coffee_table", None)
        await do("hsr", "pick", object="cup_2", place="living_room")
        await do("hsr", "place", object="cup_2", place="hallway")
        assert truth(fleet, "cup_2") == ("hallway", "hallway_table", None)
        contacts = fleet.world.backend.contacts()
        assert (contacts.robot_robot, contacts.robot_wall) == (0, 0)
