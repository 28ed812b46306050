"""`robotctl world`: places, objects, facts, statements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli import completion
from cli.command import Call, command, group
from cli.commands.closures import close, open_
from cli.commands.world_add import add

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import RenderableType

    from cli.plans.replaced_world import Leaving
    from keyexpr_schema.payloads.closures import Region
    from keyexpr_schema.payloads.world import Object, Place
    from keyexpr_schema.transport.session import Session

app = group("Places, objects, facts and statements: what the fleet is told of its world.")


@command(app, "load")
async def load(
    call: Call,
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="A world's file, or name as home.",
            autocompletion=completion.worlds,
        ),
    ],
    replace: Annotated[
        bool,
        typer.Option("--replace", help="What the file does not name leaves, with facts of it."),
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="With --replace: also what something is under way with.")
    ] = False,
) -> None:
    """Put the places and objects of a world file (not where the objects are)."""
    from cli.client.world import put_world
    from cli.errors import BadArgument
    from sim.files.world_file import load_world
    from sim.files.world_payloads import object_payloads, place_payloads, region_payloads

    if force and not replace:
        raise BadArgument("--force goes with --replace")
    world = load_world(file)
    async with call.session() as session:
        # Working out the distances takes a second: only once there is somebody to tell.
        places, objects = place_payloads(world), object_payloads(world)
        regions = region_payloads(world)
        leaves = await _leaving(session, places, objects, regions, force) if replace else None
        await put_world(session, places, objects, regions)
        if leaves is not None:
            await _take_out(session, leaves)
    gone = [] if leaves is None else [*leaves.places, *leaves.regions, *leaves.objects]
    facts = [] if leaves is None else [str(key) for key in leaves.facts]
    said = f"\nforgot {', '.join(gone)}, and {len(facts)} facts" if gone else ""
    call.show(
        {"places": places, "objects": objects, "forgotten": gone, "forgotten_facts": facts},
        lambda: (
            f"loaded {world.world}: places {', '.join(p.place for p in places)}; "
            f"objects {', '.join(o.object for o in objects) or 'none'}{said}"
        ),
    )


async def _leaving(
    session: Session,
    places: Iterable[Place],
    objects: Iterable[Object],
    regions: Iterable[Region],
    force: bool,
) -> Leaving:
    """What is to leave.

    Raises:
        Refused: something is under way with it, and that is not to be forced.
    """
    from cli.client.fleet_view import FLEET_KEYS, snapshot
    from cli.errors import Refused
    from cli.plans.replaced_world import in_use, leaving
    from keyexpr_schema.keyspace import OBJECT, PLACE, REGION

    view = await snapshot(session, *FLEET_KEYS)
    known_places = [address.place for address in await session.list(PLACE)]
    known_objects = [address.object for address in await session.list(OBJECT)]
    leaves = leaving(
        view,
        known_places,
        known_objects,
        [each.place for each in places],
        [each.object for each in objects],
        [address.region for address in await session.list(REGION)],
        [each.region for each in regions],
    )
    used = in_use(view, leaves)
    if used and not force:
        raise Refused(
            f"nothing was replaced, for what the file leaves out is in use: {'; '.join(used)}. "
            "Wait, cancel that, or say --force"
        )
    return leaves


async def _take_out(session: Session, leaves: Leaving) -> None:
    from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, REGION
    from keyexpr_schema.payloads.closures import RegionAddress
    from keyexpr_schema.payloads.world import FactAddress, ObjectAddress, PlaceAddress

    for key in leaves.facts:
        await session.delete(FACT, FactAddress.of(key))
    for name in leaves.objects:
        await session.delete(OBJECT, ObjectAddress(name))
    for name in leaves.places:
        await session.delete(PLACE, PlaceAddress(name))
    for name in leaves.regions:
        await session.delete(REGION, RegionAddress(name))


command(app, "add")(add)
command(app, "close")(close)
command(app, "open")(open_)


@command(app, "list")
async def list_(call: Call) -> None:
    """Everything that is known of the world."""
    from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, STATEMENT, STATEMENT_STATUS

    async with call.session() as session:
        places = sorted((await session.list(PLACE)).values(), key=lambda each: each.place)
        objects = sorted((await session.list(OBJECT)).values(), key=lambda each: each.object)
        facts = sorted((await session.list(FACT)).values(), key=lambda fact: fact.key)
        statements = sorted(
            (await session.list(STATEMENT)).values(), key=lambda each: each.statement
        )
        read = {a.statement: s for a, s in (await session.list(STATEMENT_STATUS)).items()}

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.views import world

        parts = [
            world.places_table(places) if places else "No places: load a world file.",
            world.objects_table(objects) if objects else "No objects.",
            world.facts_table(facts) if facts else "No facts.",
            world.statements_table(statements, read) if statements else "No statements.",
        ]
        return Group(*(part for each in parts for part in (each, "")))

    call.show(
        {
            "places": places,
            "objects": objects,
            "facts": facts,
            "statements": statements,
            "read": [read[s.statement] for s in statements if s.statement in read],
        },
        draw,
    )


@command(app, "delete")
async def delete(
    call: Call,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME",
            help="Places, objects, statements, facts as 'at(cup_1)'; or one RELATION SUBJECT.",
            autocompletion=completion.world_names,
        ),
    ],
) -> None:
    """Forget statements, objects, places or facts; where one is not there, none of them."""
    from cli.client.world import named_in_world

    async with call.session() as session:
        found = await named_in_world(session, words)
        for key, address, _ in found:
            await session.delete(key, address)
    gone = [said for _, _, said in found]
    call.show({"deleted": gone}, lambda: "\n".join(f"deleted {said}" for said in gone))
