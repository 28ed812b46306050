"""`robotctl acl`: who may do what, from the table of keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.command import Call, single
from cli.commands.certs import DirOption, authority_of

if TYPE_CHECKING:
    from rich.table import Table

    from keyexpr_schema.principals import Principal


@single
def acl(
    call: Call,
    who: Annotated[
        str | None, typer.Argument(metavar="IDENTITY", help="Show what this one may do.")
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(
            "--into", metavar="FILE", help="Put it into a router's configuration (plain JSON)."
        ),
    ] = None,
    folder: DirOption = None,
) -> None:
    """Access control for routers: all whose certificates hold, and what the key-space gives them.

    `robotctl certs` writes it into the routers' configurations by itself. A router reads it when it
    starts.
    """
    import json

    if who is not None:
        _show_one(call, who, folder)
        return
    control = authority_of(call, folder).access_control()
    if into is not None:
        _write(into, control)
        call.show(
            {"file": str(into)},
            lambda: f"{into} has it; start the router again (Zenoh reads it when it starts)",
        )
        return
    call.show(
        {"access_control": control}, lambda: json.dumps({"access_control": control}, indent=2)
    )


def _write(path: Path, control: dict[str, Any]) -> None:
    """Put it into a file that is there.

    Raises:
        BadFile: it cannot be read as JSON, or not be written.
    """
    from cli.certificates.zenoh_settings import with_access_control
    from cli.errors import BadFile
    from keyexpr_schema.whole_files import write_whole

    try:
        write_whole(path, with_access_control(path.read_text("utf-8"), control).encode())
    except OSError as error:
        raise BadFile(f"{path} cannot be changed: {error.strerror or error}") from None
    except ValueError as error:
        raise BadFile(
            f"{path} cannot be changed: {error}; it has to be JSON, below lines that begin with "
            "//: else paste what `robotctl acl` prints"
        ) from None


def _show_one(call: Call, who: str, folder: Path | None) -> None:
    from cli.certificates.identity import Identity
    from cli.errors import BadArgument
    from keyexpr_schema.keyspace import KEYSPACE
    from keyexpr_schema.principals import Principal

    principal = Principal.certified(Identity.parse(who).common_name)
    if principal is None:
        raise BadArgument("routers pass on what others are allowed: they may do everything")
    if (lacks := _not_certified(call, principal.name, folder)) is not None:
        call.warn(f"Warning: {lacks}; this is what it would be allowed")
    rows = [
        {"key": key.name, "writes": principal.writes(key), "reads": principal.reads(key)}
        for key in KEYSPACE
        if principal.writes(key) or principal.reads(key)
    ]
    call.show(rows, lambda: _drawn(principal, rows))


def _not_certified(call: Call, name: str, folder: Path | None) -> str | None:
    """Why nobody may be known to routers by that name, as far as is known here; `None`: one is."""
    from cli.errors import BadCertificates

    try:
        known = authority_of(call, folder).known()
    except BadCertificates as error:
        return f"whether {name} has a certificate is not known here, since {error}"
    if name in known:
        return None
    kind, _, own = name.partition(".")
    make = f"certs {kind} {own}" if own else f"certs service {kind}"
    has = ", ".join(known) or "nobody"
    return (
        f"nobody has a certificate of {name} that holds (those that have one: {has}): "
        f"`robotctl {make}` makes it"
    )


def _drawn(principal: Principal, rows: list[dict[str, str | None]]) -> Table:
    from rich.table import Table

    table = Table(title=f"What {principal.name} may do", box=None, pad_edge=False)
    for title in ("may write, or ask", "may read"):
        table.add_column(title, overflow="fold")
    for row in rows:
        table.add_row(row["writes"] or "", row["reads"] or "")
    return table
