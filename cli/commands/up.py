"""`robotctl up`, `ps`, `logs`, `down`: a whole fleet on this machine, in one command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.command import Call, single
from cli.commands.processes import BackendOption, SpeedOption, parse_speed
from cli.commands.worker import SIM, EmbodimentOption

if TYPE_CHECKING:
    from collections.abc import Iterable

    from cli.deployment.engines import Target
    from cli.processes.fleet_up import FleetUp
    from cli.processes.up_options import UpOptions
    from cli.processes.up_state import UpState
    from keyexpr_schema.payloads.deployments import Deployment

LOOK_S = 0.1
UP_LOG = "up.log"
"""What a detached `up` prints itself."""
DOWN_S = 60.0
"""How long `down` waits for an `up` that ends one layer of processes after the other."""


@single
def up(
    call: Call,
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="MISSION|FILE",
            help="A mission; or robots' files, with --robots.",
            autocompletion=completion.missions,
        ),
    ] = None,
    robots: Annotated[
        bool, typer.Option("--robots", help="What is named are robots' files, not a mission.")
    ] = False,
    detach: Annotated[
        bool, typer.Option("--detach", help="Return once all are there; `down` ends them.")
    ] = False,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--dir",
            metavar="DIR",
            help="Logs, recording, and what a mission's fleet keeps; else runs/MISSION-TIME, "
            "without a mission ~/.local/state/robotfleet/REALM.",
        ),
    ] = None,
    backend: BackendOption = "mujoco",
    speed: SpeedOption = "1",
    embodiment: EmbodimentOption = SIM,
    record: Annotated[
        bool, typer.Option("--record/--no-record", help="Whether a recorder runs, too.")
    ] = True,
    secure: Annotated[
        bool,
        typer.Option(
            "--secure", help="Over TLS, with certificates on both sides; made where there are none."
        ),
    ] = False,
) -> None:
    """Start router, planner, recorder, workers, and for a mission its world; stay until Ctrl-C.

    A process that ends is started again; a simulated world is not, for it cannot go on from where
    it was. Without a mission it is the fleet of this machine, with all that was known when it last
    ended, and each robot has a worker from when it is registered until it is unregistered. A
    mission's world begins anew each time.
    """
    import asyncio

    from cli.errors import BadArgument
    from cli.processes.up_options import UpOptions
    from cli.processes.up_state import only_up

    named = tuple(what or ())
    if robots and not named:
        raise BadArgument("--robots: name the files of robots, such as configs/robots/hsr.yaml")
    if len(named) > 1 and not robots:
        raise BadArgument("one mission is up at a time; files of robots go with --robots")
    parse_speed(speed)
    options = UpOptions(
        mission=named[0] if named and not robots else None,
        files=named if robots else (),
        folder=folder,
        backend=backend,
        speed=speed,
        embodiment=embodiment,
        record=record,
        secure=secure,
    )
    state = _state_folder(call)
    if detach:
        options.read()  # what is wrong with it is told here, and nothing is started
        _announce(call, _detached(call, options, state), detached=True)
        return
    with only_up(state, call.settings.realm):
        fleet = options.fleet(call.settings, state, call.warn, call.by)
        if fleet.mission is not None and options.backend == "mujoco":
            from sim.reachability import out_of_reach

            for sentence in out_of_reach(fleet.mission):
                call.warn(f"note: {sentence}")
        call.warn(f"starting {options.title}; logs go to {fleet.processes.out}")
        asyncio.run(_until_signal(call, fleet))


async def _until_signal(call: Call, fleet: FleetUp) -> None:
    """Keep a fleet up until Ctrl-C, SIGTERM, or the end of its terminal; that is no failure."""
    import asyncio
    import signal

    keeping = asyncio.ensure_future(fleet.run(lambda up: _announce(call, up, detached=False)))
    told: list[signal.Signals] = []

    def end(signum: signal.Signals) -> None:
        if not told:
            told.append(signum)
            keeping.cancel()

    for signum in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(signum, end, signum)
    try:
        await keeping
    except asyncio.CancelledError:
        if not told:
            raise
    call.warn("the fleet is down")
    if not fleet.was_ready:
        raise typer.Exit(128 + told[0])


def _detached(call: Call, options: UpOptions, state: Path) -> UpState:
    """Start this command once more, in a session of its own; what it says once all are there.

    Raises:
        BadArgument: one is up.
        ProcessDied: it ended before that; the message has its last words.
    """
    import os
    import subprocess
    import sys
    import time

    from cli.errors import ProcessDied
    from cli.processes.child_processes import last_words
    from cli.processes.identity import ProcessId
    from cli.processes.up_state import begun, only_up, running_state
    from keyexpr_schema.private_files import open_private, write_private

    settings = call.settings
    routers = [word for each in settings.routers for word in ("--router", each)]
    config = None if settings.of_up else settings.zenoh_config
    log = state / UP_LOG
    with only_up(state, settings.realm):  # else the log of the one that runs would be emptied
        write_private(log, b"")
    with os.fdopen(open_private(log, os.O_WRONLY | os.O_APPEND), "ab") as out:
        process = subprocess.Popen(
            [
                *(sys.executable, "-P", "-m", "cli.main", "up", *options.arguments()),
                *("--realm", settings.realm, *(routers if settings.said else ())),
                *(() if config is None else ("--zenoh-config", str(config))),
                *("--as", call.by),
            ],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )
    begun(state, ProcessId.of(process.pid), settings.realm, options.mission)
    try:
        while process.poll() is None:
            up = running_state(state)
            if up is not None and up.process and up.process.pid == process.pid and up.ready:
                return up
            time.sleep(LOOK_S)
    except BaseException:
        process.terminate()  # it ends what it has started
        process.wait()
        raise
    raise ProcessDied(f"the fleet did not come up{last_words(log)}; its log is {log}")


def _announce(call: Call, up: UpState, detached: bool) -> None:
    from cli.settings import DEFAULT_REALM

    here = "" if up.realm == DEFAULT_REALM else f" --realm {up.realm}"
    ends = f"`robotctl down{here}` ends it" if detached else "Ctrl-C ends it"
    call.show(
        up,
        lambda: (
            f"the fleet is up in realm {up.realm} on {up.endpoint}: "
            f"{', '.join(child.name for child in up.children)}\n"
            f"robotctl finds it by itself: `robotctl{here} status`, "
            f'`robotctl{here} goal add "…" --plan`; {ends}'
        ),
    )


@single
def ps(call: Call) -> None:
    """The processes that `up` runs: pid, since when, how often started again, where its log is."""
    from cli.views.processes import processes_table

    up = _running(call)
    call.show(up, lambda: processes_table(up))


@single
async def logs(
    call: Call,
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME",
            help="Of processes, as `ps` has them, or deployed robots; else of all processes.",
            autocompletion=completion.processes,
        ),
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", "-f", help="Go on with what comes, until Ctrl-C.")
    ] = False,
    lines: Annotated[
        int, typer.Option("--lines", "-n", min=0, metavar="N", help="The last so many of each.")
    ] = 20,
) -> None:
    """What processes of `up` have printed; after their end, too, until the next `up`. And what the
    workers of deployed robots print, where they run."""
    import asyncio
    import json

    from cli.deployment.running import container_lines
    from cli.errors import NotRunning
    from cli.processes.log_files import followed, last_lines
    from cli.processes.up_state import read_state

    folder = _state_folder(call)
    up = read_state(folder)
    if up is None and not names:
        raise NotRunning(f"no fleet was ever up in realm {call.settings.realm}: `robotctl up`")
    known = {child.name: Path(child.log) for child in up.children} if up else {}
    if (folder / UP_LOG).exists():
        known["up"] = folder / UP_LOG
    chosen = list(dict.fromkeys(names or known))
    elsewhere = [name for name in chosen if name not in known]
    containers = await _containers(call, elsewhere, known) if elsewhere else {}
    told = {name: last_lines(known[name], lines) for name in chosen if name in known}
    if call.json and not follow:
        pages = [
            {"process": name, "log": str(known[name]), "lines": last}
            for name, (_, last) in told.items()
        ]
        for name, (record, target) in containers.items():
            printed = [line async for line in container_lines(record, target, lines, follow=False)]
            pages.append({"process": name, "log": record.where, "lines": printed})
        call.show(pages, lambda: "")
        return
    width = max(len(name) for name in chosen) if len(chosen) > 1 else 0

    def tell(name: str, line: str) -> None:
        before = f"{name:{width}}  " if width else ""
        typer.echo(json.dumps({"process": name, "line": line}) if call.json else f"{before}{line}")

    async def tell_more(name: str, at: int) -> None:
        async for line in followed(known[name], at):
            tell(name, line)

    async def tell_contained(name: str) -> None:
        async for line in container_lines(*containers[name], lines, follow=follow):
            tell(name, line)

    for name, (_, last) in told.items():
        for line in last:
            tell(name, line)
    async with asyncio.TaskGroup() as group:
        for name in containers:
            group.create_task(tell_contained(name))
        for name, (at, _) in told.items() if follow else ():
            group.create_task(tell_more(name, at))


async def _containers(
    call: Call, names: list[str], processes: Iterable[str]
) -> dict[str, tuple[Deployment, Target]]:
    """Where these robots are deployed.

    Raises:
        Unknown: one is neither that nor a process.
    """
    from cli.client.deployments import find
    from cli.errors import Unknown, check_known
    from keyexpr_schema.keyspace import DEPLOYMENT, ROBOT_SPEC

    async with call.session() as session:
        deployed = {address.robot for address in await session.list(DEPLOYMENT)}
        registered = {address.robot for address in await session.list(ROBOT_SPEC)}
        for name in names:
            if name in registered - deployed and "workers" in processes:
                raise Unknown(
                    f"{name} is not deployed; what the workers of `up` print is in "
                    "`robotctl logs workers`"
                )
            check_known("process or deployed robot", name, {*processes, *deployed})
        return {name: await find(session, name) for name in names}


@single
async def down(
    call: Call,
    wait_s: Annotated[
        float,
        typer.Option("--wait-s", min=0.0, metavar="SECONDS", help="Then what runs is killed."),
    ] = DOWN_S,
) -> None:
    """End what `up` runs, in order, and wait for it; nothing but what `up` has started is ended."""
    from cli.errors import TooLate
    from cli.processes.take_down import processes_of, take_down
    from cli.processes.up_state import begun_state

    up = await begun_state(_state_folder(call))
    ended = up is not None and any(each.alive for each in processes_of(up))
    left = [] if up is None else await take_down(up, wait_s, call.warn)
    if left:
        pids = ", ".join(str(each.pid) for each in left)
        raise TooLate(f"these did not end although they were killed: pid {pids}")
    none = f"no fleet is up in realm {call.settings.realm}"
    call.show({"ended": ended}, lambda: "the fleet is down" if ended else none)


def _running(call: Call) -> UpState:
    from cli.errors import NotRunning
    from cli.processes.up_state import running_state

    up = running_state(_state_folder(call))
    if up is None:
        raise NotRunning(
            f"no fleet is up in realm {call.settings.realm} on this machine: `robotctl up` "
            "starts one"
        )
    return up


def _state_folder(call: Call) -> Path:
    from cli.errors import BadSettings
    from cli.processes.up_state import state_folder

    folder = state_folder(call.settings.realm)
    if folder is None:
        raise BadSettings("there is no HOME and no XDG_STATE_HOME to keep the state of `up` in")
    return folder
