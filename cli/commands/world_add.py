"""`robotctl world add`: a sentence, a fact, an object or a place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

_GOES_WITH = {
    "--id": ("a sentence",),
    "--speaker": ("a sentence",),
    "--label": ("--object", "--place"),
    "--alias": ("--object", "--place"),
    "--kind": ("--object",),
    "--home": ("--object",),
    "--mass-kg": ("--object",),
    "--feature": ("--object",),
    "--part-of": ("--object",),
    "--fixed": ("--object",),
    "--region": ("--place",),
    "--distance": ("--place",),
}
"""Each option of `world add`: the forms that take it."""


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
    speaker: Annotated[
        str | None,
        typer.Option(
            "--speaker", metavar="PERSON", help='Who says it, of the people in the world: "I".'
        ),
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
        str | None,
        typer.Option(
            "--home", metavar="PLACE", help="The place or object where the object belongs."
        ),
    ] = None,
    mass_kg: Annotated[
        float | None, typer.Option("--mass-kg", min=0.0, help="What the object weighs; else 0.")
    ] = None,
    feature: Annotated[
        list[str] | None,
        typer.Option(
            "--feature",
            metavar="WORD",
            help="What can be done with it: supports, contains, openable, switchable, person, …; "
            "repeatable.",
        ),
    ] = None,
    part_of: Annotated[
        str | None, typer.Option("--part-of", metavar="ID", help="The object that it is a part of.")
    ] = None,
    fixed: Annotated[
        bool, typer.Option("--fixed", help="It does not move; it is at its --home.")
    ] = False,
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
    from cli.client.planner_requests import statement_status
    from cli.client.presence import planner_alive
    from cli.client.publish import put_fact, put_statement
    from cli.client.world import put_object, put_place
    from cli.errors import BadArgument, Refused
    from cli.views.text import statement_means

    _check_options(
        sentence=bool(words) and not fact,
        fact=fact,
        object=thing is not None,
        place=place is not None,
        given={
            "--id": name,
            "--speaker": speaker,
            "--label": label,
            "--alias": alias,
            "--kind": kind,
            "--home": home,
            "--mass-kg": mass_kg,
            "--feature": feature,
            "--part-of": part_of,
            "--fixed": fixed or None,
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
            kept = await put_object(
                session,
                thing,
                kind or "",
                label,
                tuple(alias or ()),
                home,
                mass_kg,
                tuple(feature or ()),
                part_of,
                fixed,
            )
            call.show(kept, lambda: f"stored object {kept.object}: “{kept.label}”, a {kept.kind}")
        elif place is not None:
            room = await put_place(
                session, place, label, tuple(alias or ()), region or (), distance or ()
            )
            call.show(room, lambda: f"stored place {room.place}: “{room.label}”")
        elif fact:
            await _check_declared(call, session, *words)
            stated = await put_fact(session, *words, by=call.by)
            call.show(stated, lambda: f"stored {stated.literal}")
        else:
            statement = await put_statement(session, " ".join(words), name, speaker, call.by)
            status = await statement_status(session, statement.statement)
            if status is not None and not status.facts:
                raise Refused(
                    f"statement {statement.statement} is kept as it was said, “{statement.text}”"
                    f"{statement_means(status)}"
                )
            means = statement_means(status)
            if status is None and await planner_alive(session):
                means = ", which the planner has not read yet"
            elif status is None:
                means = ". No planner is running: it will be read once one runs"
            call.show(
                {"statement": statement, "status": status},
                lambda: f"stored statement {statement.statement}: “{statement.text}”{means}",
            )


async def _check_declared(
    call: Call, session: Session, relation: str, subject: str, written: str
) -> None:
    """Hold a fact against what there is, and what the skill files here declare of its relation.

    Where the planner has skills that these files do not, it may know a relation that they do not.

    Raises:
        BadArgument: they declare it for other things, or other values.
        Unknown: there is nothing of the subject's name, or nobody has heard of the relation.
    """
    from cli.client.planner_requests import acting_planner
    from cli.errors import BadArgument, check_known, near_miss
    from cli.plans.worlds import world_of_fleet
    from fleet.core.model.declarations import misfit, relations_of
    from fleet.service.skill_models import load_all_skills
    from keyexpr_schema.facts import FactKey, Literal, parse_value

    world = await world_of_fleet(session, load_all_skills(), only_connected=False)
    named = {*world.places, *world.objects, *world.robots}
    check_known(
        "object, place or robot", subject, named, "load a world with `robotctl world load FILE`"
    )
    relations = relations_of(world)
    if relation not in relations:
        planner = await acting_planner(session)
        all_known = planner is not None and set(planner.skills) <= set(world.skills)
        if all_known or near_miss(relation, relations):
            check_known("relation", relation, relations)
        call.warn(f"note: no skill that is known here speaks of {relation!r}")
    wrong = misfit(Literal(FactKey(relation, subject), parse_value(written)), world)
    if wrong is not None:
        raise BadArgument(wrong)


def _check_options(
    *, sentence: bool, fact: bool, object: bool, place: bool, given: Mapping[str, object]
) -> None:
    """Do nothing if the options belong to one form.

    Raises:
        BadArgument: of none, of two at once, or an option goes with another form.
    """
    from cli.errors import BadArgument

    forms = {"a sentence": sentence, "--fact": fact, "--object": object, "--place": place}
    chosen = [form for form, wanted in forms.items() if wanted]
    if not chosen:
        raise BadArgument("say a sentence, or tell of a --fact, an --object or a --place")
    if len(chosen) > 1:
        raise BadArgument(f"{' and '.join(chosen)} are different things to tell: choose one")
    for option, value in given.items():
        if value not in (None, []) and chosen[0] not in _GOES_WITH[option]:
            raise BadArgument(f"{option} goes with {' or '.join(_GOES_WITH[option])}")
    if object and not given["--kind"]:
        raise BadArgument("an object has a --kind, such as cup")
