"""`robotctl stop`, `pause`, `resume`, `drain`, `return`: robots rest, and go on."""

from __future__ import annotations

from typing import Annotated

import typer

from cli.arguments import (
    AnyRobotsArgument,
    PlansArgument,
    RobotsArgument,
    RobotsOption,
    WhyOption,
)
from cli.command import Call, single

AllOption = Annotated[bool, typer.Option("--all", help="Every robot, also those that come later.")]
WAIT_S = 3.0


@single
async def stop(
    call: Call,
    robots: AnyRobotsArgument = None,
    all_: AllOption = False,
    robot: RobotsOption = None,
    why: WhyOption = "",
    wait: Annotated[
        float,
        typer.Option("--wait", min=0.0, metavar="SECONDS", help="How long to wait for their word."),
    ] = WAIT_S,
) -> None:
    """Emergency stop: robots come to rest and stay there until `robotctl resume`.

    Workers and simulated drivers obey it by themselves, whether a planner runs or not. Ends with
    exit code 1 while there is a robot that has not confirmed that it rests, or where there is none.
    """
    from contextlib import AsyncExitStack

    from cli.client.stops import AWAY, give_stop, how_to_resume
    from cli.errors import NotRunning
    from keyexpr_schema.errors import Unreachable

    named = tuple(dict.fromkeys((*(robots or ()), *(robot or ()))))
    if all_ == bool(named):
        raise typer.BadParameter("say either --all, or which robots")

    def confirmed(name: str) -> None:
        if not call.json:
            call.inform(f"{name} rests")

    told = []

    def away(name: str) -> None:
        call.warn(f"NOT CONFIRMED: {name}: {AWAY}")
        told.append(name)

    async with AsyncExitStack() as stack:
        try:
            session = await stack.enter_async_context(call.session(urgent=True))
        except Unreachable as error:
            raise NotRunning(f"NOBODY IS STOPPED by this: {error}") from None
        outcome = await give_stop(session, named, call.by, why, wait, confirmed, away)
    call.show(outcome, lambda: f"{outcome.stop} stands; `{how_to_resume(outcome.stop)}` ends it")
    for name, reason in outcome.unconfirmed.items():
        if name not in told:
            call.warn(f"NOT CONFIRMED: {name}: {reason}")
    nobody = not outcome.confirmed and not outcome.unconfirmed
    if nobody:
        call.warn(
            "NOBODY IS IN REACH: no robot is registered, and no worker is connected, in realm "
            f"{call.settings.realm}; who comes there stays still"
        )
    if outcome.unstored is not None:
        call.warn(f"NOT STORED: who is started again does not know of it: {outcome.unstored}")
    if nobody or outcome.unconfirmed or outcome.unstored is not None:
        raise typer.Exit(1)


@single
async def pause(
    call: Call,
    plans: PlansArgument = None,
    all_: AllOption = False,
    robot: RobotsOption = None,
    now: Annotated[
        bool, typer.Option("--now", help="Interrupt what runs; else it still ends.")
    ] = False,
    why: WhyOption = "",
) -> None:
    """Give no new order to robots, in plans, or at all, until `robotctl resume`.

    What runs ends, or with --now is interrupted and done again later. Work stays where it is.
    """
    from cli.client.holds import check_names, put_holds
    from keyexpr_schema.payloads.holds import HoldKind

    _which(all_, robot, plans)
    async with call.session() as session:
        await check_names(session, robot or (), plans or ())
        put = await put_holds(
            session, HoldKind.PAUSE, robot or (), plans or (), call.by, why, interrupt=now
        )
    call.show(put.holds, lambda: str(put))


@single
async def resume(
    call: Call,
    plans: PlansArgument = None,
    all_: AllOption = False,
    robot: RobotsOption = None,
) -> None:
    """End emergency stops and pauses: work goes on from the facts.

    --all ends every emergency stop and the pause of the whole fleet, not those of single robots or
    plans.
    """
    from msgspec.structs import asdict

    from cli.client.holds import check_no_robots, end_holds, in_words, still_paused
    from cli.client.stops import Resumed, lift_stops
    from keyexpr_schema.payloads.holds import HoldKind

    _which(all_, robot, plans)
    async with call.session() as session:
        await check_no_robots(session, plans or ())
        resumed = Resumed()
        if robot or all_:
            resumed = await lift_stops(session, robot or (), call.by)
        ended = await end_holds(session, HoldKind.PAUSE, robot or (), plans or ())
        paused = await still_paused(session, (*(robot or ()), *(plans or ())))
    names = dict.fromkeys((*resumed.still_held, *paused))
    held = {name: (*resumed.still_held.get(name, ()), *paused.get(name, ())) for name in names}
    lines = [f"{stop} lifted" for stop in resumed.lifted]
    freed = resumed.released.items()
    lines += [f"{stop} holds {' and '.join(robots)} no longer" for stop, robots in freed]
    lines += [f"no longer: {in_words(hold)}" for hold in ended]
    call.show(
        {**asdict(resumed), "ended": ended, "still_held": held},
        lambda: "\n".join(lines) or "No stop and no pause stands there.",
    )
    for name, by_what in held.items():
        call.warn(f"{name} is still held: {'; '.join(by_what)}")
    if held:
        raise typer.Exit(1)


@single
async def drain(call: Call, robots: RobotsArgument, why: WhyOption = "") -> None:
    """Take robots out: each ends its task and delivers what it carries; others do the rest.

    Nothing is planned with it until `robotctl return`.
    """
    from cli.client.holds import check_names, put_holds
    from keyexpr_schema.payloads.holds import HoldKind

    async with call.session() as session:
        await check_names(session, robots, ())
        put = await put_holds(session, HoldKind.DRAIN, robots, (), call.by, why)
    call.show(put.holds, lambda: str(put))


@single
async def return_(call: Call, robots: RobotsArgument) -> None:
    """Put robots back that were drained: they are planned with again."""
    from cli.client.holds import check_names, end_holds, in_words
    from keyexpr_schema.payloads.holds import HoldKind

    async with call.session() as session:
        await check_names(session, robots, ())
        ended = await end_holds(session, HoldKind.DRAIN, robots)
    lines = [f"no longer: {in_words(hold)}" for hold in ended]
    call.show(ended, lambda: "\n".join(lines) or f"{', '.join(robots)} was not drained.")


def _which(everybody: bool, robots: list[str] | None, plans: list[str] | None) -> None:
    if everybody == bool(robots or plans):
        raise typer.BadParameter("say either --all, or which: --robot NAME, or plans")
