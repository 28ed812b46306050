"""What people see of batteries."""

from __future__ import annotations

import io

import pytest
from msgspec.structs import replace
from rich.console import Console

from cli.client.health import Health
from cli.overview.needs import needs_of
from cli.overview.page import FleetPage
from cli.overview.situation import Filters, Situation
from cli.views.robots import RobotRow, robots_table
from cli.views.text import charge
from keyexpr_schema.payloads.robots import RobotState
from tests.support.busy_fleet import busy_fleet


def states(**percent: float) -> dict[str, RobotState]:
    known = busy_fleet().robot_states
    return {robot: replace(known[robot], charge=value) for robot, value in percent.items()}


def situation(**percent: float) -> Situation:
    view = busy_fleet()
    view.robot_states.update(states(**percent))
    return Situation(view, Filters(robots=frozenset(percent)), Health(frozenset(percent)))


@pytest.mark.parametrize(
    ("percent", "said"),
    [(None, ""), (100.0, "100 %"), (63.2, "64 %"), (0.4, "1 %"), (0.0, "empty")],
)
def test_a_charge_is_a_percentage_and_empty_only_if_nothing_is_left(
    percent: float | None, said: str
) -> None:
    assert charge(replace(busy_fleet().robot_states["r1"], charge=percent)) == said


def test_status_and_robots_show_it() -> None:
    file = io.StringIO()
    screen = Console(file=file, width=120, height=60)
    screen.print(FleetPage(situation(r1=63.2, r2=12.0), []))
    rows = [
        RobotRow(robot=robot, connected=True, spec=None, state=state)
        for robot, state in states(r1=41.0).items()
    ]
    screen.print(robots_table(rows))
    shown = file.getvalue()
    assert "64 %" in shown and "12 %" in shown and "41 %" in shown


def test_an_empty_robot_needs_a_person() -> None:
    needs = [each for each in needs_of(situation(r1=0.0, r2=12.0)) if each.kind == "empty"]
    assert [each.about for each in needs] == [("r1",)]
    assert needs[0].sentence.startswith("the battery of r1 is empty: it stays")
