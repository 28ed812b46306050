"""`robotctl register`, `unregister`, `robots`."""

from __future__ import annotations

from typing import Annotated

import typer

from cli import completion
from cli.arguments import AnyRobotsArgument, RobotArgument, WhyOption
from cli.command import Call, single


@single
async def register(
    call: Call,
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE",
            help="Robots' files, or names as hsr.",
            autocompletion=completion.robot_files,
        ),
    ],
    name: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="NAME",
            help="Call the robot so, as a second one of a file; else as `robot:` there says.",
        ),
    ] = None,
) -> None:
    """Declare robots from YAML files; declaring one again replaces what was said of it.

    Who declares it is said before the command here: `robotctl --as ana register FILE --as hsr_2`.
    """
    from msgspec.structs import replace

    from cli.client.names import check_free
    from cli.client.planner_requests import check_skills
    from cli.errors import BadArgument
    from keyexpr_schema.ids import check_name
    from keyexpr_schema.keyspace import ROBOT_SPEC
    from keyexpr_schema.payloads.robots import RobotAddress
    from sim.files.robot_file import load_robot

    specs = [replace(load_robot(file), by=call.by) for file in files]
    if name is not None:
        if len(specs) > 1:
            raise BadArgument("--as is the name of one robot; register the others by themselves")
        check_name(name, "robot")
        specs = [replace(specs[0], robot=name)]
    for spec in specs:
        if sum(other.robot == spec.robot for other in specs) > 1:
            raise BadArgument(
                f"two of the files are of a robot {spec.robot!r}; register one of them "
                "by itself, with --as NAME"
            )
    async with call.session() as session:
        await check_skills(session, specs)
        for spec in specs:
            await check_free(session, spec.robot, "robot")
        for spec in specs:
            await session.confirm(ROBOT_SPEC, RobotAddress(spec.robot), spec)
    call.show(
        specs,
        lambda: "\n".join(
            f"registered {s.robot}, which can {', '.join(s.skills) or 'do nothing'}" for s in specs
        ),
    )


@single
async def unregister(
    call: Call,
    robot: RobotArgument,
    wait: Annotated[
        float,
        typer.Option("--wait", min=0.0, metavar="SECONDS", help="How long to wait until it rests."),
    ] = 30.0,
    force: Annotated[
        bool, typer.Option("--force", help="Also if it carries something, or does not answer.")
    ] = False,
    why: WhyOption = "",
) -> None:
    """Take a robot out of the fleet for good.

    Its work is cancelled and goes to others. When its worker has said that it rests, what is stored
    of it is forgotten. A robot that carries something, or that has not said so in time, stays.
    """
    from cli.client.planner_requests import check_robot
    from cli.client.unregistering import unregister as forget

    async with call.session() as session:
        await check_robot(session, robot)
        gone = await forget(session, robot, call.by, why, wait, force)
    call.show(gone, lambda: f"unregistered {robot}")
    if gone.unconfirmed is not None:
        call.warn(f"NOT CONFIRMED: {robot}: {gone.unconfirmed}")
    if gone.carried:
        call.warn(f"nobody knows where {' and '.join(gone.carried)} is from now on")


@single
async def robots(call: Call, names: AnyRobotsArgument = None) -> None:
    """Every robot, or those that are named: what it can do, whether it is connected and deployed,
    where it is, what it does."""
    from cli.client.fleet_view import snapshot
    from cli.client.presence import robots_alive
    from cli.errors import check_known
    from cli.views.robots import robot_rows, robots_table
    from keyexpr_schema.keyspace import DEPLOYMENT, ROBOT_SPEC, ROBOT_STATE

    async with call.session() as session:
        view = await snapshot(session, ROBOT_SPEC, ROBOT_STATE)
        connected = await robots_alive(session)
        deployed = {a.robot: each for a, each in (await session.list(DEPLOYMENT)).items()}
    rows = robot_rows(view.robot_specs, view.robot_states, connected, deployed)
    for name in names or ():
        check_known("robot", name, (row.robot for row in rows))
    rows = [row for row in rows if not names or row.robot in names]
    call.show(rows, lambda: robots_table(rows) if rows else "No robots are registered.")


@single
async def durations(call: Call) -> None:
    """How long each type of robot really takes, learned from its reports."""
    from cli.views.robots import durations_table
    from keyexpr_schema.keyspace import DURATIONS

    async with call.session() as session:
        known = await session.list(DURATIONS)
    rows = sorted(known.values(), key=lambda each: each.model)
    call.show(
        rows, lambda: durations_table(rows) if rows else "No robot has reported a task done yet."
    )
