"""How robots carry out the skills of `settings/apartment.skills.yaml` in `household_world`."""

from __future__ import annotations

import asyncio
from contextlib import aclosing
from typing import Protocol, runtime_checkable

from benchmarks.planning.household_world import (
    FULL,
    Deed,
    filling,
    lifting,
    locking_up,
    lowering,
    mopping,
    pouring,
    serving,
    slicing,
    waiting,
)
from keyexpr_schema.facts import AT, IS_ON, IS_OPEN, NOTHING, Value
from keyexpr_schema.payloads.motions import (
    Detection,
    Motion,
    MotionKind,
    MotionOutcome,
    MotionState,
)
from workers.errors import SkillFailed
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, Skill, skill
from workers.skills.looking_around import looks
from workers.skills.viewpoints import Viewing

_OBJECT, _PLACE, _ROBOT = ParameterKind.OBJECT, ParameterKind.PLACE, ParameterKind.ROBOT


@runtime_checkable
class WorkingEmbodiment(Protocol):
    """An embodiment that can also work with what it has in its hand, and steer a partner."""

    async def work(self, takes_s: float, deed: Deed) -> MotionOutcome:
        """Be at work; returns when that has ended."""

    async def perform_as(self, robot: str, motion: Motion) -> MotionOutcome:
        """A motion of a partner in a joint skill."""


@skill(
    "slice",
    parameters={"thing": _OBJECT, "tool": _OBJECT, "board": _OBJECT, "place": _PLACE},
)
async def slice_thing(ctx: SkillContext, thing: str, tool: str, board: str, place: str) -> None:
    """Cut something on a board with the knife in the hand."""
    await _with_tool(ctx, tool, place)
    await _come_up_to(ctx, board, place)
    await _work(ctx, 20.0, slicing(thing))
    ctx.observe("sliced", thing, True)


@skill("mop", parameters={"room": _PLACE, "tool": _OBJECT})
async def mop(ctx: SkillContext, room: str, tool: str) -> None:
    """Wipe the floor of a room with the mop in the hand."""
    await _with_tool(ctx, tool, room)
    await _work(ctx, 45.0, mopping(room))
    ctx.observe("mopped", room, True)


@skill("wash", parameters={"thing": _OBJECT, "sink": _OBJECT, "place": _PLACE})
async def wash(ctx: SkillContext, thing: str, sink: str, place: str) -> None:
    """Let the tap run over what is in the sink until that is clean."""
    await _until_seen(ctx, thing, sink, place, "clean", True)


@skill("heat", parameters={"thing": _OBJECT, "stove": _OBJECT, "place": _PLACE})
async def heat(ctx: SkillContext, thing: str, stove: str, place: str) -> None:
    """Wait until a pot on a stove that is on is hot."""
    await _until_seen(ctx, thing, stove, place, "temperature", "hot")


@skill("run_machine", parameters={"machine": _OBJECT, "place": _PLACE})
async def run_machine(ctx: SkillContext, machine: str, place: str) -> None:
    """Wait by a machine until its programme is over; what is in it cannot be seen meanwhile."""
    await ctx.be_in(place)
    await ctx.look()
    if ctx.known(IS_ON, machine) is not True or ctx.known(IS_OPEN, machine) is not False:
        raise SkillFailed(f"{machine} does not run: it must be on and closed", retryable=False)
    await _work(ctx, 62.0, waiting)


@skill("fill", parameters={"jug": _OBJECT, "sink": _OBJECT, "place": _PLACE})
async def fill(ctx: SkillContext, jug: str, sink: str, place: str) -> None:
    """Fill the jug in the hand at a running tap."""
    await _with_tool(ctx, jug, place)
    await _come_up_to(ctx, sink, place)
    await _work(ctx, 10.0, filling(sink))
    ctx.observe("level", jug, FULL)


@skill("water", parameters={"plant": _OBJECT, "jug": _OBJECT, "place": _PLACE})
async def water(ctx: SkillContext, plant: str, jug: str, place: str) -> None:
    """Water a plant from the jug in the hand."""
    await _pour(ctx, plant, "watered", jug, place)


@skill("pour", parameters={"glass": _OBJECT, "jug": _OBJECT, "place": _PLACE})
async def pour(ctx: SkillContext, glass: str, jug: str, place: str) -> None:
    """Fill a cup or glass from the jug in the hand."""
    await _pour(ctx, glass, "filled", jug, place)


@skill(
    "carry_together",
    parameters={"partner": _ROBOT, "thing": _OBJECT, "place": _PLACE, "to": _PLACE},
)
async def carry_together(ctx: SkillContext, partner: str, thing: str, place: str, to: str) -> None:
    """Carry something bulky to another place, with a partner that stands beside it, too.

    Whoever is ordered leads: the partner's motions are asked for from here.
    """
    held = await ctx.holding()
    if held != thing:  # an earlier try may have taken it up
        if held is not None:
            raise SkillFailed(f"{ctx.robot} has no hand free: it holds {held}", retryable=False)
        await ctx.be_in(place)
        seen = _seen(await ctx.look(), thing)
        if seen is None:
            raise SkillFailed(
                f"{thing} is not to be seen in {place}", facts=((AT, thing, None),), retryable=False
            )
        await ctx.do(MotionKind.APPROACH, point_m=seen.point_m)
        await _work(ctx, 8.0, lifting(thing, partner))
    whole = _whole(ctx)
    drives = [ctx.do(MotionKind.GO_TO, place=to), _partner_drives(whole, partner, to)]
    await asyncio.gather(*drives)
    await _work(ctx, 8.0, lowering(thing, partner))
    for robot in (ctx.robot, partner):
        ctx.observe("holding", robot, NOTHING)
        ctx.observe(AT, robot, to)
    ctx.observe(AT, thing, to)


@skill("serve", parameters={"table": _OBJECT, "place": _PLACE})
async def serve(ctx: SkillContext, table: str, place: str) -> None:
    """Call to dinner once there are three dishes on the table."""
    await ctx.be_in(place)
    await _work(ctx, 5.0, serving(table))
    ctx.observe("served", table, True)


@skill("lock_up", parameters={"place": _PLACE})
async def lock_up(ctx: SkillContext, place: str) -> None:
    """Go round once more when everything is closed and switched off."""
    await ctx.be_in(place)
    await _work(ctx, 5.0, locking_up(place))
    ctx.observe("locked_up", place, True)


TOOL_SKILLS: tuple[Skill, ...] = (
    slice_thing,
    mop,
    wash,
    heat,
    run_machine,
    fill,
    water,
    pour,
    carry_together,
    serve,
    lock_up,
)
"""What the benchmark's robots can do besides the household's skills."""


async def _partner_drives(whole: WorkingEmbodiment, partner: str, to: str) -> None:
    outcome = await whole.perform_as(partner, Motion(kind=MotionKind.GO_TO, place=to))
    if outcome.state is not MotionState.SUCCEEDED:
        raise SkillFailed(f"{partner} did not come along: {outcome.reason}")


async def _pour(ctx: SkillContext, target: str, becomes: str, jug: str, place: str) -> None:
    await _with_tool(ctx, jug, place)
    await _come_up_to(ctx, target, place)
    before = ctx.known("level", jug)
    await _work(ctx, 8.0, pouring(target, becomes))
    ctx.observe(becomes, target, True)
    ctx.observe("level", jug, before - 1 if isinstance(before, int | float) else None)


async def _until_seen(
    ctx: SkillContext, thing: str, appliance: str, place: str, state: str, value: Value
) -> None:
    """Wait before an appliance that is on until the thing is seen to be as it should."""
    await ctx.be_in(place)
    await _come_up_to(ctx, appliance, place)
    if ctx.known(IS_ON, appliance) is not True:
        raise SkillFailed(f"{appliance} is not on", retryable=False)
    for _ in range(6):
        if ctx.known(state, thing) == value:
            return
        await _work(ctx, 10.0, waiting)
        await ctx.look()
    raise SkillFailed(f"{thing} was at {appliance} for a minute, and {state} is not {value}")


async def _with_tool(ctx: SkillContext, tool: str, place: str) -> None:
    held = await ctx.holding()
    if held != tool:
        raise SkillFailed(
            f"{ctx.robot} holds {held or NOTHING}, and needs {tool} for this", retryable=False
        )
    await ctx.be_in(place)


async def _come_up_to(ctx: SkillContext, thing: str, place: str) -> None:
    """To before a thing, or what it is on or in, wherever in the place that is to be seen."""
    viewing = Viewing.of(ctx.world.places[place], ctx.spec)
    async with aclosing(looks(ctx, viewing)) as every:
        async for seen in every:
            found = next((seen[n] for n in (thing, *ctx.world.carriers(thing)) if n in seen), None)
            if found is not None:
                await ctx.do(MotionKind.APPROACH, point_m=found.point_m)
                await ctx.look()
                return
    raise SkillFailed(f"{thing} is not to be seen in {place}", retryable=False)


def _seen(detections: tuple[Detection, ...], thing: str) -> Detection | None:
    return next((d for d in detections if d.object == thing), None)


async def _work(ctx: SkillContext, takes_s: float, deed: Deed) -> None:
    outcome = await _whole(ctx).work(takes_s, deed)
    if outcome.state is not MotionState.SUCCEEDED:
        raise SkillFailed(outcome.reason or "the work came to nothing")


def _whole(ctx: SkillContext) -> WorkingEmbodiment:
    if not isinstance(ctx.embodiment, WorkingEmbodiment):
        raise SkillFailed(f"{ctx.robot} cannot work with tools", retryable=False)
    return ctx.embodiment
