"""What happens, as it happens: a picture that is redrawn on a terminal, else a line a change."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Any

import msgspec
import typer
from rich.console import Group, RenderableType
from rich.live import Live
from rich.text import Text

from cli.terminal import json_text
from cli.times import moment, with_iso
from cli.views.console import console, table
from cli.views.plan_tree import plan_tree
from cli.views.text import carried, charge, doing, skill_call
from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.goals import GoalStatus
from keyexpr_schema.payloads.plans import PlanStatus
from keyexpr_schema.payloads.robots import Alive
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from cli.overview.situation import Filters
    from keyexpr_schema.key import Address, Key
    from keyexpr_schema.payloads.robots import AliveAddress, RobotState
    from keyexpr_schema.transport.session import Change, TokenChange

REDRAW_S = 0.2
"""How often the picture is redrawn, so that running tasks count up."""


class ChangePrinter:
    """Prints each change of a goal, plan or task as a line, where nothing draws a picture.

    `to_stderr` keeps stdout for data; `only` says what is of interest.
    """

    def __init__(self, to_stderr: bool, only: Filters | None = None) -> None:
        self.to_stderr = to_stderr
        self._only = only
        self._printed: dict[str, str] = {}
        self.silent = False

    def on_worker(self, change: TokenChange[AliveAddress]) -> None:
        """Print that a robot's worker has come or gone."""
        robot = change.address.robot
        if self.silent or not (self._only is None or self._only.admits_robot(robot)):
            return
        said = "is connected" if change.alive else "is away: its worker is not connected"
        typer.echo(f"{moment(time.time()):<12}  {robot} {said}", err=self.to_stderr)

    @property
    def draws(self) -> bool:
        """Whether there is a terminal to draw on."""
        return (sys.stderr if self.to_stderr else sys.stdout).isatty()

    def on_change(self, change: Change[Any, Any]) -> None:
        """Print the change if it is worth a line that was not printed."""
        line = change_line(change.value)
        if line is None or self.silent:
            return
        if self._only is not None and not self._only.admit(change.value):
            return
        time_s, sentence = line
        where = change.key.build(change.address)
        if self._printed.get(where) != sentence:
            self._printed[where] = sentence
            when = moment(getattr(change.value, "wall_time_s", None), time_s)
            typer.echo(f"{when:<12}  {sentence}", err=self.to_stderr)


class AsJson:
    """Prints each change as a line of JSON: its key and its value, `null` where that is gone.

    `only` says what is of interest; of other keys than those of tasks, goals and plans, those that
    name a robot, goal or plan of it are.
    """

    def __init__(self, only: Filters) -> None:
        self._only = only

    def on_change(self, change: Change[Any, Any]) -> None:
        """Print the change if it is of interest."""
        if self._is_of_interest(change.address, change.value):
            _print_json(change.key, change.address, change.value)

    def on_worker(self, change: TokenChange[AliveAddress]) -> None:
        """Print that a robot's worker has come or gone: a token carries no value."""
        if self._only.admits_robot(change.address.robot):
            _print_json(ROBOT_ALIVE, change.address, Alive() if change.alive else None)

    def _is_of_interest(self, address: Address, value: object) -> bool:
        only = self._only
        if not only.any or isinstance(value, TaskRecord | PlanStatus | GoalStatus):
            return only.admit(value)
        named = (("robot", only.robots), ("goal", only.goals), ("plan", only.plans))
        return any(getattr(address, what, None) in names for what, names in named)


def _print_json(key: Key[Any, Any], address: Address, value: object) -> None:
    what = {"key": key.build(address), "value": value}
    plain = msgspec.to_builtins(what, str_keys=True)
    typer.echo(json_text(msgspec.json.encode(with_iso(plain))))


def change_line(what: object) -> tuple[float | None, str] | None:
    """What happened, and when on the fleet's clock [s]; `None` if it is not worth a line."""
    if isinstance(what, TaskRecord):
        time_s = {
            TaskState.ORDERED: what.ordered_s,
            TaskState.RUNNING: what.started_s,
        }.get(what.state, what.ended_s)
        attempt = f" (attempt {what.attempt})" if what.attempt > 1 else ""
        return time_s, (
            f"{what.plan}/{what.task} {skill_call(what.skill, what.args, what.robot)} "
            f"{what.robot or what.actor}: {what.state.value}{attempt}{_because(what.reason)}"
        )
    if isinstance(what, GoalStatus):
        return what.time_s, f"goal {what.goal} is {what.state.value}{_because(what.reason)}"
    if isinstance(what, PlanStatus):
        who = ", ".join(f"{actor}→{robot}" for actor, robot in what.allocation.items())
        return what.time_s, (
            f"plan {what.plan} revision {what.revision} is {what.state.value}"
            f"{f' ({who})' if who else ''}{_because(what.reason)}"
        )
    return None


def _because(reason: str | None) -> str:
    return f": {reason}" if reason else ""


def picture(
    view: FleetView, only: str | None = None, connected: Collection[str] | None = None
) -> RenderableType:
    """Plans as trees and robots as a table; `connected` are those whose worker is there (`None`:
    nobody has asked)."""
    parts: list[RenderableType] = []
    clock = view.now_s
    parts += clock_line(view)
    for name in sorted(view.plans):
        if only not in (None, name):
            continue
        plan, status = view.plans[name], view.plan_status.get(name)
        parts.append(
            plan_tree(plan, status, view.records(name), view.goals, view.goal_status, clock)
        )
    if not view.plans:
        waiting = ", ".join(view.goals) or "none"
        parts.append(f"No plan yet; goals: {waiting}")
    parts.append(
        table(
            ["robot", "activity", "charge", "place", "holding", "task"],
            (
                (s.robot, _activity(s, connected), charge(s), s.place, carried(s), doing(s))
                for _, s in sorted(view.robot_states.items())
            ),
        )
    )
    return Group(*parts)


def _activity(state: RobotState, connected: Collection[str] | None) -> str:
    away = connected is not None and state.robot not in connected
    return "away" if away else state.activity.value


def clock_line(view: FleetView) -> list[Text]:
    """What time it is, and of a simulation how long its mission has been going on."""
    clock = None if view.clock is None else view.clock.time_s
    return [Text(moment(time.time(), clock), "bold")]


@asynccontextmanager
async def live_view(
    view: FleetView,
    printer: ChangePrinter,
    draw: Callable[[FleetView], RenderableType] = picture,
) -> AsyncIterator[None]:
    """Redraw `view` on the terminal during the block; without one the changes are printed."""
    if not printer.draws:
        yield
        return
    printer.silent = True
    screen = console(sys.stderr if printer.to_stderr else sys.stdout)
    with Live(console=screen, auto_refresh=False, transient=False) as live:

        async def redraw() -> None:
            while True:
                live.update(draw(view), refresh=True)
                await asyncio.sleep(REDRAW_S)

        task = asyncio.create_task(redraw())
        try:
            yield
        finally:
            task.cancel()
            await asyncio.wait([task])
            live.update(draw(view), refresh=True)
            printer.silent = False
