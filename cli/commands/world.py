"""`robotctl world`: places, objects, facts, statements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, command, group
from cli.commands.closures import close, open_
from cli.commands.world_add import add

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.transport.session import Session

app = group("Places, objects, facts and statements: what the fleet is told of its world.")


@command(app, "load")
async def load(
    call: Call,
    file: Annotated[str, typer.Argument(metavar="FILE", help="A world's file, or name as home.")],
) -> None:
    """Put the places and objects of a world file (not where the objects are)."""
    from cli.client.world import put_world
    from sim.files.world_file import load_world
    from sim.files.world_payloads import object_payloads, place_payloads, region_payloads

    world = load_world(file)
    async with call.session() as session:
        # Working out the distances takes a second: only once there is somebody to tell.
        places, objects = place_payloads(world), object_payloads(world)
        await put_world(session, places, objects, region_payloads(world))
    call.show(
        {"places": places, "objects": objects},
        lambda: (
            f"loaded {world.world}: places {', '.join(p.place for p in places)}; "
            f"objects {', '.join(o.object for o in objects) or 'none'}"
        ),
    )


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
        typer.Argument(metavar="NAME", help="A place, object or statement; or RELATION SUBJECT."),
    ],
) -> None:
    """Forget a statement, object or place by its name, or a fact by its relation and subject."""
    from cli.errors import BadArgument

    if len(words) > 2:
        raise BadArgument("give one name, or a fact's RELATION and SUBJECT, such as 'at cup_1'")
    async with call.session() as session:
        if len(words) == 2:
            gone = await _delete_fact(session, *words)
        else:
            gone = await _delete_named(session, words[0])
    call.show({"deleted": gone}, lambda: f"deleted {gone}")


async def _delete_fact(session: Session, relation: str, subject: str) -> str:
    from cli.errors import check_known
    from keyexpr_schema.facts import FactKey
    from keyexpr_schema.keyspace import FACT
    from keyexpr_schema.payloads.world import FactAddress

    facts = [" ".join(address.key) for address in await session.list(FACT)]
    check_known("fact", f"{relation} {subject}", facts, "see `robotctl world add --fact`")
    key = FactKey(relation, subject)
    await session.delete(FACT, FactAddress.of(key))
    return str(key)


async def _delete_named(session: Session, name: str) -> str:
    from cli.errors import check_known
    from keyexpr_schema.keyspace import OBJECT, PLACE, STATEMENT
    from keyexpr_schema.payloads.world import ObjectAddress, PlaceAddress, StatementAddress

    statements = [a.statement for a in await session.list(STATEMENT)]
    objects = [a.object for a in await session.list(OBJECT)]
    places = [a.place for a in await session.list(PLACE)]
    check_known(
        "statement, object or place",
        name,
        [*statements, *objects, *places],
        "load a world with `robotctl world load FILE`",
    )
    if name in statements:
        await session.delete(STATEMENT, StatementAddress(name))
        return f"statement {name}"
    if name in objects:
        await session.delete(OBJECT, ObjectAddress(name))
        return f"object {name}"
    await session.delete(PLACE, PlaceAddress(name))
    return f"place {name}"
