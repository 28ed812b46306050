"""`robotctl deploy`, `undeploy`: robots' workers as containers, here or elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import RobotArgument
from cli.command import Call, single

if TYPE_CHECKING:
    from cli.deployment.engines import Step, Target
    from cli.deployment.launch import Launch

OnOption = Annotated[
    str | None,
    typer.Option(
        "--on",
        metavar="WHERE",
        help="podman, docker, ssh HOST or kubernetes; else where its file says, or podman here.",
    ),
]
HostArgument = Annotated[
    str | None, typer.Argument(metavar="HOST", help="As ssh takes it; or a node of the cluster.")
]
DryRunOption = Annotated[
    bool, typer.Option("--dry-run", help="Print what would be run, and run nothing.")
]


@single
async def deploy(
    call: Call,
    file: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT",
            help="Its file, or the name of that as hsr.",
            autocompletion=completion.robot_files,
        ),
    ],
    host: HostArgument = None,
    on: OnOption = None,
    dry_run: DryRunOption = False,
    name: Annotated[
        str | None,
        typer.Option("--as", metavar="NAME", help="The robot's name; else as its file says."),
    ] = None,
    wait_s: Annotated[
        float,
        typer.Option("--wait", min=0.0, metavar="SECONDS", help="For its worker to connect."),
    ] = 60.0,
) -> None:
    """Run a robot's worker as a container, and wait until it is connected.

    What is run is what the robot's file says under `deployment:`, and --dry-run prints.
    """
    from cli.client import deployments
    from cli.client.planner_requests import check_robot
    from cli.deployment.launch import launch
    from cli.deployment.running import run
    from cli.errors import NotDeployed
    from keyexpr_schema.ids import check_name
    from sim.files.robot_file import load_deployment

    spec, entry = load_deployment(file)
    robot = spec.robot if name is None else name
    check_name(robot, "robot")
    settings = call.settings
    what = launch(robot, entry, settings.routers, settings.realm, said=settings.said)
    target = _target(on, host, entry.host)
    if target.over_ssh or target.in_a_cluster:
        what.check_reaches(target.where)
    step = target.start(what)
    if dry_run:
        _print(call, [step])
        return
    async with call.session() as session:
        await check_robot(session, robot)
        await deployments.check_free(session, robot)
        done = await run(step, target)
        if done.code:
            raise NotDeployed(await _why_not(done.said, what, target))
        record = await deployments.note(session, what, target, call.by)
        connected = await deployments.until_connected(session, robot, wait_s)
    call.show(record, lambda: f"{robot} is deployed: {record.where}, as {what.name}")
    if not connected:
        raise NotDeployed(
            f"{robot} runs as {what.name} {target.where}, and its worker has not connected within "
            f"{wait_s:g} s: `robotctl logs {robot}` has what it says"
        )


@single
async def undeploy(
    call: Call,
    robot: RobotArgument,
    dry_run: DryRunOption = False,
) -> None:
    """End what `deploy` has run for a robot: it comes to rest first. Its journal stays.

    The robot is away then, as when its worker was ended otherwise: what it was to do waits, and
    goes to others. `drain` before that has it end what it is at.
    """
    from cli.client import deployments
    from cli.deployment.running import plain, run
    from cli.errors import NotDeployed

    async with call.session() as session:
        record, target = await deployments.find(session, robot)
        steps = target.end(record.container)
        if dry_run:
            _print(call, steps)
            return
        for step in steps:
            done = await run(step, target)
            if done.code and (await run(target.has_container(record.container), target)).code == 0:
                raise NotDeployed(
                    f"{record.container} could not be ended {target.where}: {plain(done.said)}"
                )
            if done.code:
                call.warn(f"{record.container} was not there any more {target.where}")
                break
        await deployments.forget(session, robot)
    call.show(record, lambda: f"{robot} is not deployed any more ({record.where})")


def _target(on: str | None, host: str | None, of_file: str | None) -> Target:
    """Where to. `--on` without a host is here, but for ssh; the file's host is for no `--on`, for
    ssh and for a cluster."""
    import re

    from cli.deployment.engines import Target
    from cli.errors import BadArgument, check_known
    from keyexpr_schema.payloads.deployments import HOST_PATTERN, Engine

    check_known("place to deploy on", on or "podman", [*(each.value for each in Engine), "ssh"])
    if host is not None and not re.fullmatch(HOST_PATTERN, host):
        raise BadArgument(f"{host!r} is not a host as ssh takes it, as ana@lab-3")
    if on in ("podman", "docker"):
        return Target(Engine(on), host)
    if on == "ssh" and host is None and of_file is None:
        raise BadArgument("--on ssh: name the host, as in `robotctl deploy hsr --on ssh lab-3`")
    engine = Engine.KUBERNETES if on == "kubernetes" else Engine.PODMAN
    return Target(engine, host or of_file)


def _print(call: Call, steps: list[Step] | tuple[Step, ...]) -> None:
    shown = [{"argv": step.argv, "stdin": step.stdin} for step in steps]
    call.show(shown, lambda: "\n".join(map(str, steps)))


async def _why_not(said: str, what: Launch, target: Target) -> str:
    """Why a container could not be run, in a sentence."""
    from cli.deployment.running import plain, run

    if not target.in_a_cluster:
        if (await run(target.has_container(what.name), target)).code == 0:
            # It was made and could not begin: gone, so that the next try is not in its way.
            known = (await run(target.discard(what.name), target)).code == 0
            return f"{what.name} could not begin {target.where}: {plain(said)}" + (
                "" if known else f"; it is still there, `{target.discard(what.name)}` removes it"
            )
        if (await run(target.has_image(what.image), target)).code != 0:
            return (
                f"there is no image {what.image} {target.where}, and it could not be pulled "
                f"({plain(said)}): build it as docs/deployment.md says, or name another under "
                "deployment.image"
            )
    return f"{what.robot} could not be deployed {target.where}: {plain(said)}"
