"""`robotctl demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.arguments import MissionArgument
from cli.command import Call, single
from cli.commands.plans import ProgramsOption
from cli.commands.processes import BackendOption, parse_speed

if TYPE_CHECKING:
    from rich.console import RenderableType

    from cli.demo.mission_run import Demo, DemoOptions
    from cli.demo.summary import Summary
    from cli.views.live import ChangePrinter


@single
async def demo(
    call: Call,
    mission: MissionArgument,
    backend: BackendOption = "mujoco",
    speed: Annotated[
        str, typer.Option("--headless-speed", help="Simulated seconds a second, or max.")
    ] = "max",
    view: Annotated[bool, typer.Option("--view", help="Show it live in Rerun, too.")] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Logs, data, recording; else runs/MISSION-TIME."),
    ] = None,
    programs: ProgramsOption = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout-s", min=1.0, help="Longest time for the plan, by the wall.")
    ] = 600.0,
) -> None:
    """Run a whole mission here: router, simulation, planner, workers and recorder, each a process.

    Exit code 0 only if the planner says that every goal is reached and the physics agrees.
    """
    import msgspec

    from cli.demo.mission_run import DemoOptions
    from cli.errors import check_known
    from cli.processes.run_folder import SUMMARY, new_run_folder
    from cli.views.live import ChangePrinter
    from keyexpr_schema.private_files import write_private
    from sim.files.mission_file import load_mission
    from sim.reachability import out_of_reach
    from sim.server.process import BACKENDS

    check_known("backend", backend, BACKENDS)
    parse_speed(speed)
    loaded = load_mission(mission)
    if backend == "mujoco":
        for sentence in out_of_reach(loaded):
            call.warn(f"note: {sentence}")
    options = DemoOptions(
        mission=mission,
        out=out or new_run_folder(loaded.mission),
        backend=backend,
        speed=speed,
        view=view,
        timeout_s=timeout_s,
        programs=programs,
        zenoh_config=call.settings.zenoh_config,
    )
    summary = await _run(options, ChangePrinter(call.json), call)

    def draw() -> RenderableType:
        from cli.views.demo_summary import summary_page

        return summary_page(summary)

    text = msgspec.json.format(msgspec.json.encode(summary), indent=2)
    write_private(options.out / SUMMARY, text)
    call.show(summary, draw)
    if not summary.ok:
        raise typer.Exit(1)


async def _run(options: DemoOptions, printer: ChangePrinter, call: Call) -> Summary:
    """Bring everything up, carry the mission out, take everything down, however it ends."""
    import asyncio
    import signal

    from cli.demo.mission_run import running_demo

    me = asyncio.current_task()
    terminated = False

    def stop() -> None:
        nonlocal terminated
        terminated = True
        if me is not None:
            me.cancel()

    # SIGTERM ends the demo as Ctrl-C does: by cancellation, so that no process stays behind.
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop)
    call.warn(f"starting {options.mission}; logs go to {options.out}")
    try:
        async with running_demo(options, printer.on_change) as demo:
            return await demo.processes.guard(_play(demo, printer))
    except asyncio.CancelledError:
        if terminated:
            raise typer.Exit(128 + signal.SIGTERM) from None
        raise


async def _play(demo: Demo, printer: ChangePrinter) -> Summary:
    from cli.views.live import live_view

    async with live_view(demo.view, printer):
        await demo.submit()
        await demo.wait_until_ended()
    return await demo.verify()
