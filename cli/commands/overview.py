"""`robotctl status`, `watch`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import AnyPlanArgument
from cli.command import Call, single

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import RenderableType

    from cli.client.fleet_view import FleetView

OnlyRobots = Annotated[
    list[str] | None,
    typer.Option(
        "--robot",
        metavar="NAME",
        help="Only what concerns this robot; repeatable.",
        autocompletion=completion.robots,
    ),
]
OnlyGoals = Annotated[
    list[str] | None,
    typer.Option(
        "--goal",
        metavar="NAME",
        help="Only what concerns this goal; repeatable.",
        autocompletion=completion.goals,
    ),
]
OnlyPlans = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="NAME",
        help="Only what concerns this plan; repeatable.",
        autocompletion=completion.plans,
    ),
]
NeedsMe = Annotated[bool, typer.Option("--needs-me", help="Only what needs a person.")]
Ended = Annotated[bool, typer.Option("--ended", help="Show what is over, too, one by one.")]


@single
async def status(
    call: Call,
    robot: OnlyRobots = None,
    goal: OnlyGoals = None,
    plan: OnlyPlans = None,
    needs_me: NeedsMe = False,
    ended: Ended = False,
    whole: Annotated[
        bool, typer.Option("--all", help="Everything, also where that is longer than the screen.")
    ] = False,
) -> None:
    """The fleet on one page: what needs a person, what runs, what waits and why, and robots.

    On a terminal it is no longer than the screen: what does not fit is counted.
    """
    import sys

    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.client.health import health
    from cli.overview.needs import needs_of
    from cli.overview.page import FleetPage
    from cli.overview.situation import Filters, Situation
    from cli.views.goals import goal_row
    from cli.views.robots import robot_rows
    from cli.views.status import head_lines

    async with call.session() as session:
        view = await snapshot(session, *FLEET_KEYS)
        _check_names(view, robot, goal, plan)
        found = await health(session)
    filters = Filters.of(robot, goal, plan)
    shown = Situation(view, filters, found)
    settings = call.settings
    robots = {name for name, *_ in shown.robots}
    head = head_lines(settings.routers, settings.realm, found, offers=whole)
    call.show(
        {
            "routers": settings.routers,
            "realm": settings.realm,
            "planner": {"running": found.planning, "status": found.planner},
            "needs_person": needs_of(shown),
            "running": shown.running,
            "waiting": shown.waiting,
            "robots": [
                row
                for row in robot_rows(view.robot_specs, view.robot_states, found.connected)
                if row.robot in robots
            ],
            "goals": [
                goal_row(status.goal, view.wanted, view.goal_status)
                for status in shown.goals
                if status.goal in view.wanted
            ],
            "plans": shown.every_plan,
            "diagnostics": found.diagnostics,
            "stops": list(view.stops.values()),
            "holds": list(view.holds.values()),
            "closures": view.standing_closures(),
            "schedules": list(view.schedule_status.values()),
            "rejects": found.undecodable,
        },
        lambda: FleetPage(
            shown,
            head,
            whole=whole or not sys.stdout.isatty(),
            needs_me=needs_me,
            ended=ended,
        ),
    )


@single
async def watch(
    call: Call,
    only: AnyPlanArgument = None,
    robot: OnlyRobots = None,
    goal: OnlyGoals = None,
    plan: OnlyPlans = None,
    needs_me: NeedsMe = False,
    ended: Ended = False,
) -> None:
    """Follow goals, plans and tasks until Ctrl-C; one plan alone as a tree.

    On a terminal a picture; piped, a line a change; with --json, a JSON document a line.
    """
    from cli.client.fleet_view import FLEET_KEYS, SIMULATION_KEYS, fleet_view, snapshot
    from cli.client.health import health_followed
    from cli.overview.page import FleetPage
    from cli.overview.situation import Filters, Situation
    from cli.views.live import AsJson, ChangePrinter, clock_line, live_view, picture
    from cli.views.status import head_lines

    plans = [*(plan or ()), *([only] if only else ())]
    filters = Filters.of(robot, goal, plans)
    if call.json:
        said = AsJson(filters)
        async with call.session() as session:
            if filters.any:
                _check_names(await snapshot(session, *FLEET_KEYS), robot, goal, plans)
            async with (
                fleet_view(session, *FLEET_KEYS, on_change=said.on_change) as all_,
                health_followed(session, said.on_worker),
            ):
                await all_.forever()
    printer = ChangePrinter(to_stderr=False, only=filters)

    def draw(view: FleetView) -> RenderableType:
        if only is not None:
            return picture(view, only, health.now.connected)
        head = head_lines(call.settings.routers, call.settings.realm, health.now)
        situation = Situation(view, filters, health.now)
        return FleetPage(situation, [*clock_line(view), *head], needs_me=needs_me, ended=ended)

    async with call.session() as session:
        if filters.any:
            _check_names(await snapshot(session, *FLEET_KEYS), robot, goal, plans)
        async with (
            fleet_view(session, *FLEET_KEYS, *SIMULATION_KEYS, on_change=printer.on_change) as view,
            health_followed(session, printer.on_worker) as health,
            live_view(view, printer, draw),
        ):
            await view.forever()


def _check_names(
    view: FleetView,
    robots: Iterable[str] | None,
    goals: Iterable[str] | None,
    plans: Iterable[str] | None,
) -> None:
    from cli.errors import check_known

    for what, names, known in (
        ("robot", robots, view.robot_specs),
        ("goal", goals, {**view.wanted, **view.goal_status}),
        ("plan", plans, view.plan_status),
    ):
        for name in names or ():
            check_known(what, name, known)
