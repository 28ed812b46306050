"""`robotctl world close` and `open`: where robots do not drive, or one at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.arguments import WhyOption
from cli.command import Call

if TYPE_CHECKING:
    from keyexpr_schema.payloads.closures import Rectangle

NamesArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="NAME", help="Places, doors, zones.", autocompletion=completion.regions),
]


async def close(
    call: Call,
    names: NamesArgument = None,
    box: Annotated[
        list[str] | None,
        typer.Option("--box", metavar="X,Y,X,Y", help="A rectangle of the floor [m]."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option("--for", metavar="MODEL", help="Only for robots of this model."),
    ] = None,
    one_at_a_time: Annotated[
        bool, typer.Option("--one-at-a-time", help="Let in one robot, and the next after it.")
    ] = False,
    until: Annotated[
        str | None,
        typer.Option("--until", metavar="TIME", help="14:30, 2026-11-28T14:30, or 15min from now."),
    ] = None,
    why: WhyOption = "",
) -> None:
    """Close places, doors or zones: no robot enters until `robotctl world open`.

    Who is in there may finish and leave. Plans go around, or wait and say so.
    """
    from cli.client.closures import in_words, put_closures
    from cli.times import now_here, parse_until

    if not names and not box:
        raise typer.BadParameter("name a place, a door or a zone, or give --box X,Y,X,Y")
    if one_at_a_time and model:
        raise typer.BadParameter("--one-at-a-time is for all robots: leave --for out")
    for_s = None if until is None else parse_until(until, "--until", now_here())
    boxes = [_box(written) for written in box or ()]
    async with call.session() as session:
        closures = await put_closures(
            session,
            names or (),
            boxes,
            model or (),
            call.by,
            why,
            one_at_a_time=one_at_a_time,
            for_s=for_s,
        )
    call.show(closures, lambda: "\n".join(f"{each.closure}: {in_words(each)}" for each in closures))


async def open_(
    call: Call,
    names: NamesArgument = None,
    all_: Annotated[bool, typer.Option("--all", help="Everything that is closed.")] = False,
) -> None:
    """Open what was closed: robots drive there again, and what waited for it goes on."""
    from cli.client.closures import end_closures

    if all_ == bool(names):
        raise typer.BadParameter("say either --all or what to open")
    async with call.session() as session:
        ended = await end_closures(session, names or ())
    call.show(
        ended, lambda: "\n".join(f"no longer: {each}" for each in ended) or "Nothing is closed."
    )


def _box(written: str) -> Rectangle:
    from cli.client.world import parse_rectangle
    from cli.errors import BadArgument

    if (rectangle := parse_rectangle(written)) is None:
        raise BadArgument(
            f"--box {written!r} is not four lengths in metres, X_MIN,Y_MIN,X_MAX,Y_MAX with each "
            "least one first: such as 1.0,2.5,3.0,4.0"
        )
    return rectangle
