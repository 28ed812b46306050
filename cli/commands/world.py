"""`robotctl world`: places, objects, facts, statements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, command
from cli.parsing import Group

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.transport.session import Session

app = typer.Typer(cls=Group, no_args_is_help=True, rich_markup_mode=None, add_completion=False)


@app.callback()
def world() -> None:
    """Places, objects, facts and statements: what the fleet is told of its world."""


@command(app, "load")
async def load(
    call: Call, file: Annotated[str, typer.Argument(metavar="FILE", help="See configs/worlds.")]
) -> None:
    """Tell the fleet the places and objects of a world file (not where the objects are)."""
    from cli.telling import put_world
    from sim.files.world_file import load_world
    from sim.files.world_payloads import object_payloads, place_payloads

    world = load_world(file)
    async with call.session() as session:
        # Working out the distances takes a second: only once there is somebody to tell.
        places, objects = place_payloads(world), object_payloads(world)
        await put_world(session, places, objects)
    call.show(
        {"places": places, "objects": objects},
        lambda: (
            f"loaded {world.world}: places {', '.join(p.place for p in places)}; "
            f"objects {', '.join(o.object for o in objects) or 'none'}"
        ),
    )


@command(app, "add")
async def add(
    call: Call,
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="STATEMENT", help="A sentence; or RELATION SUBJECT VALUE."),
    ] = None,
    fact: Annotated[
        bool, typer.Option("--fact", help="The words are a fact: RELATION SUBJECT VALUE.")
    ] = False,
    name: Annotated[
        str | None, typer.Option("--id", help="Name of the statement; else made from its words.")
    ] = None,
    thing: Annotated[
        str | None, typer.Option("--object", metavar="ID", help="Tell of an object, with --kind.")
    ] = None,
    place: Annotated[
        str | None, typer.Option("--place", metavar="ID", help="Tell of a place.")
    ] = None,
    label: Annotated[
        str | None, typer.Option("--label", help="What people call it; else its id in words.")
    ] = None,
    alias: Annotated[
        list[str] | None,
        typer.Option("--alias", metavar="NAME", help="What else they call it; repeatable."),
    ] = None,
    kind: Annotated[
        str | None, typer.Option("--kind", help="What sort of object it is, such as cup.")
    ] = None,
    home: Annotated[
        str | None, typer.Option("--home", metavar="PLACE", help="Where the object belongs.")
    ] = None,
    mass_kg: Annotated[
        float | None, typer.Option("--mass-kg", min=0.0, help="What the object weighs; else 0.")
    ] = None,
    region: Annotated[
        list[str] | None,
        typer.Option(
            "--region",
            metavar="X0,Y0,X1,Y1",
            help="A rectangle of the place's floor, in metres; repeatable.",
        ),
    ] = None,
    distance: Annotated[
        list[str] | None,
        typer.Option(
            "--distance", metavar="PLACE=METRES", help="How far another place is; repeatable."
        ),
    ] = None,
) -> None:
    """Say something of the world: a sentence, a fact, an object or a place.

    "The first cup is in the kitchen."   --fact at cup_1 kitchen
    --object cup_3 --kind cup --home kitchen   --place pantry --distance kitchen=2.5
    """
    from cli.errors import BadArgument
    from cli.show.words import statement_means
    from cli.telling import add_fact, add_statement, statement_read
    from cli.world_things import check_options, told_object, told_place

    check_options(
        sentence=bool(words) and not fact,
        fact=fact,
        object=thing is not None,
        place=place is not None,
        given={
            "--id": name,
            "--label": label,
            "--alias": alias,
            "--kind": kind,
            "--home": home,
            "--mass-kg": mass_kg,
            "--region": region,
            "--distance": distance,
        },
    )
    words = words or []
    if fact and len(words) != 3:
        raise BadArgument(
            f"a fact is RELATION SUBJECT VALUE, such as 'at cup_1 kitchen'; got {len(words)} words"
        )
    async with call.session() as session:
        if thing is not None:
            kept = await told_object(
                session, thing, kind or "", label, tuple(alias or ()), home, mass_kg
            )
            call.show(kept, lambda: f"stored object {kept.object}: “{kept.label}”, a {kept.kind}")
        elif place is not None:
            room = await told_place(
                session, place, label, tuple(alias or ()), region or (), distance or ()
            )
            call.show(room, lambda: f"stored place {room.place}: “{room.label}”")
        elif fact:
            said = await add_fact(session, *words)
            call.show(said, lambda: f"stored {said.literal}")
        else:
            told = await add_statement(session, " ".join(words), name)
            read = await statement_read(session, told.statement)
            call.show(
                {"statement": told, "status": read},
                lambda: f"stored statement {told.statement}: “{told.text}”{statement_means(read)}",
            )


@command(app, "list")
async def list_(call: Call) -> None:
    """Everything that is known of the world."""
    from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, STATEMENT, STATEMENT_STATUS

    async with call.session() as session:
        places = sorted((await session.list(PLACE)).values(), key=lambda each: each.place)
        objects = sorted((await session.list(OBJECT)).values(), key=lambda each: each.object)
        facts = sorted(
            (await session.list(FACT)).values(), key=lambda each: (each.relation, each.subject)
        )
        statements = sorted(
            (await session.list(STATEMENT)).values(), key=lambda each: each.statement
        )
        read = {a.statement: s for a, s in (await session.list(STATEMENT_STATUS)).items()}

    def draw() -> RenderableType:
        from rich.console import Group

        from cli.show import fleet_tables

        parts = [
            fleet_tables.places_table(places) if places else "No places: load a world file.",
            fleet_tables.objects_table(objects) if objects else "No objects.",
            fleet_tables.facts_table(facts) if facts else "No facts.",
            fleet_tables.statements_table(statements, read) if statements else "No statements.",
        ]
        return Group(*(part for each in parts for part in (each, "")))

    call.show(
        {
            "places": places,
            "objects": objects,
            "facts": facts,
            "statements": statements,
            "read": [read[said.statement] for said in statements if said.statement in read],
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
