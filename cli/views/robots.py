"""Robots, and how long they really take."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set

import msgspec
from rich.table import Table

from cli.views.console import table
from cli.views.text import capabilities, carried, charge, doing, seconds
from keyexpr_schema.payloads.deployments import Deployment
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.robots import RobotSpec, RobotState


class RobotRow(msgspec.Struct, frozen=True, kw_only=True):
    """One robot as `robotctl robots --json` shows it."""

    robot: str
    connected: bool
    spec: RobotSpec | None
    state: RobotState | None
    deployment: Deployment | None = None


def robot_rows(
    specs: Mapping[str, RobotSpec],
    states: Mapping[str, RobotState],
    connected: Set[str],
    deployments: Mapping[str, Deployment] | None = None,
) -> list[RobotRow]:
    """Every robot that is registered, connected or deployed; of one that is not connected, its
    last state."""
    deployed = deployments or {}
    return [
        RobotRow(
            robot=robot,
            connected=robot in connected,
            spec=specs.get(robot),
            state=states.get(robot),
            deployment=deployed.get(robot),
        )
        for robot in sorted(specs.keys() | connected | deployed.keys())
    ]


def robots_table(rows: Iterable[RobotRow]) -> Table:
    """One line a robot; where they are deployed, if one is."""
    shown = list(rows)
    deployed = any(row.deployment for row in shown)
    return table(
        [
            "robot",
            "connected",
            "activity",
            "charge",
            "place",
            "holding",
            "task",
            "skills",
            "capabilities",
            *(["deployed"] if deployed else []),
        ],
        (
            (
                row.robot,
                "yes" if row.connected else "no",
                _activity(row),
                charge(row.state),
                row.state.place if row.state else "",
                carried(row.state),
                doing(row.state),
                ", ".join(row.spec.skills) if row.spec else "not registered",
                capabilities(row.spec) if row.spec else "",
                *([row.deployment.where if row.deployment else ""] if deployed else []),
            )
            for row in shown
        ),
    )


def _activity(row: RobotRow) -> str:
    if row.state is None or not row.connected:
        return ""
    return "emergency stop" if row.state.stops else row.state.activity.value


def durations_table(rows: Iterable[Durations]) -> Table:
    """A line for each skill of each type of robot, and one for its pace."""
    return table(["model", "what", "mean", "sd", "attempts"], _duration_lines(rows))


def _duration_lines(rows: Iterable[Durations]) -> Iterator[tuple[str, ...]]:
    for known in rows:
        if known.pace is not None:
            what = "pace (1: top speed all the way)"
            pace = known.pace
            yield known.model, what, f"{pace.mean:.2f}", f"{pace.sd:.2f}", str(pace.count)
        for skill, each in sorted(known.skills.items()):
            yield known.model, skill, seconds(each.mean), seconds(each.sd), str(each.count)
