"""`robotctl certs`: who is who on the fleet's network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cli.command import Call, command, group
from keyexpr_schema.errors import SchemaError

if TYPE_CHECKING:
    from rich.table import Table

    from cli.certificates.authority import Authority
    from cli.certificates.identity import Identity

app = group("A certificate authority for the fleet: who may connect, and as whom.")

DirOption = Annotated[
    Path | None,
    typer.Option("--dir", metavar="DIR", help="Where it all is; else in ~/.local/share."),
]
DaysOption = Annotated[
    int, typer.Option("--days", min=1, max=3650, help="How long the certificates are good for.")
]
ConnectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--connect", metavar="ENDPOINT", help="Routers for its configuration: tls/HOST:PORT."
    ),
]


@command(app)
def init(call: Call, folder: DirOption = None) -> None:
    """Make the authority. Whoever has its key can be anybody: keep it off robots and routers."""
    from cli.certificates.authority import Authority

    made = Authority.create(folder_of(call, folder), call.settings.realm)
    call.show(
        {"folder": str(made.folder), "expires_s": made.expires.timestamp()},
        lambda: (
            f"the authority of realm {call.settings.realm} is in {made.folder}, and holds until "
            f"{made.expires:%Y-%m-%d}\nnext: `robotctl certs service router --host HOST "
            "--listen tls/0.0.0.0:7447`, then `robotctl certs robot ROBOT --connect "
            "tls/HOST:7447`, and so `operator NAME`, `service planner`"
        ),
    )


@command(app)
def robot(
    call: Call,
    robots: Annotated[list[str], typer.Argument(metavar="ROBOT", help="Their names.")],
    folder: DirOption = None,
    days: DaysOption = 365,
    connect: ConnectOption = None,
) -> None:
    """Certificates for robots' workers."""
    from cli.certificates.identity import Identity, Kind

    _issue(call, folder, [Identity(Kind.ROBOT, name) for name in robots], days, connect)


@command(app)
def operator(
    call: Call,
    names: Annotated[list[str], typer.Argument(metavar="NAME", help="Such as ana.")],
    folder: DirOption = None,
    days: DaysOption = 365,
    connect: ConnectOption = None,
) -> None:
    """Certificates for people, who use robotctl."""
    from cli.certificates.identity import Identity, Kind

    _issue(call, folder, [Identity(Kind.OPERATOR, name) for name in names], days, connect)


@command(app)
def service(
    call: Call,
    what: Annotated[
        str, typer.Argument(metavar="router|planner|recorder|sim|workers", help="What it is for.")
    ],
    name: Annotated[
        str | None, typer.Option("--name", help="Of a router, where there are several.")
    ] = None,
    hosts: Annotated[
        list[str] | None,
        typer.Option(
            "--host", metavar="HOST", help="A router's names and addresses, as others know it."
        ),
    ] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option("--listen", metavar="ENDPOINT", help="What a router listens on."),
    ] = None,
    folder: DirOption = None,
    days: DaysOption = 365,
    connect: ConnectOption = None,
) -> None:
    """A certificate for a router, the planner, the recorder, a world, or a host's workers."""
    from cli.certificates.identity import MAIN, SERVICES, Identity, Kind
    from cli.errors import BadArgument, check_known

    check_known("service", what, [kind.value for kind in SERVICES])
    kind = Kind(what)
    if kind is not Kind.ROUTER and (name or hosts or listen):
        raise BadArgument("--name, --host and --listen are for routers")
    identity = Identity(kind, (name or MAIN) if kind is Kind.ROUTER else "")
    _issue(call, folder, [identity], days, connect, hosts or (), listen or ())


@command(app)
async def revoke(
    call: Call,
    who: Annotated[list[str], typer.Argument(metavar="IDENTITY", help="Such as robot.hsr.")],
    folder: DirOption = None,
    replaced: Annotated[
        bool,
        typer.Option("--replaced", help="Only those that a later one took the place of."),
    ] = False,
) -> None:
    """Certificates that are not to be believed any more.

    The fleet hears which ones, and takes in nothing more that is signed with them. Zenoh asks for
    no list of these: routers let such a certificate in until it has expired, and with the access
    control that is written here it may do nothing there.
    """
    from cli.certificates.identity import Identity
    from cli.errors import BadCertificates

    authority = authority_of(call, folder)
    gone = authority.revoke([Identity.parse(name) for name in who], replaced=replaced)
    what = (
        "is revoked, and the later one holds; where it is in other hands, a router lets it in "
        "until it has expired, and nothing that is signed with it is taken in"
        if replaced
        else "is revoked, and its key deleted here; where it is in other hands, a router lets it "
        "in until it has expired, and it may do nothing there, until there is another certificate "
        "of that name"
    )
    call.show(
        gone,
        lambda: "\n".join(f"{each.identity} (serial {each.serial}) {what}" for each in gone),
    )
    renew_access(call, authority)
    if call.settings.zenoh_config is None:
        call.warn(f"next: {_PUBLISH.format(authority.revocations)}")
        return
    try:
        call.inform(known(await _publish(call, authority.revocations)))
    except (SchemaError, BadCertificates) as error:
        call.warn(
            f"the fleet has not heard of it: {error}; {_PUBLISH.format(authority.revocations)}"
        )


_PUBLISH = "`robotctl --zenoh-config OPERATOR.json5 certs publish {}` tells the fleet of it"


@command(app)
async def publish(
    call: Call,
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="The list; else that of the realm's authority."),
    ] = None,
    folder: DirOption = None,
) -> None:
    """Tell the fleet which certificates are revoked, as any operator may: the authority has signed
    the list."""
    from cli.certificates.authority import REVOKED

    revoked = await _publish(call, file or folder_of(call, folder) / REVOKED)
    call.show({"revoked": revoked}, lambda: known(revoked))


def known(revoked: Sequence[str]) -> str:
    """That the fleet has heard of these, in a sentence."""
    what = "1 revoked certificate" if len(revoked) == 1 else f"{len(revoked)} revoked certificates"
    return f"the fleet knows {what}, and takes in nothing more that is signed with such"


async def _publish(call: Call, file: Path) -> list[str]:
    """Put the lists in a file on their keys; the serial numbers in them.

    Raises:
        BadCertificates: the file cannot be read, or the fleet is reached without a certificate: one
            that judges by none would take the list in, and do nothing.
        SchemaError: it was not confirmed.
    """
    from cli.certificates.revocation_list import read_lists
    from cli.errors import BadCertificates
    from keyexpr_schema.keyspace import REVOCATIONS
    from keyexpr_schema.transport.revocations import shown

    lists = read_lists(file)
    if call.principal is None:
        raise BadCertificates(
            "who tells a fleet what is revoked has a certificate of it, and none is used here: "
            "give an operator's configuration by --zenoh-config"
        )
    async with call.session() as session:
        for each in lists:
            await session.confirm(REVOCATIONS, *shown(each))
    return [f"{each.serial_number:x}" for list_ in lists for each in list_]


@command(app, "list")
def list_(call: Call, folder: DirOption = None) -> None:
    """Every certificate that was made, and how long it is good for."""
    issued = authority_of(call, folder).issued()

    def draw() -> Table:
        from rich.table import Table

        from cli.times import moment

        table = Table(box=None, pad_edge=False)
        for title in ("who", "made", "good until", "hosts", "serial"):
            table.add_column(title, overflow="fold")
        for each in issued:
            until = "revoked" if each.revoked else moment(each.expires_s)
            until = "replaced" if each.replaced else until
            table.add_row(
                each.identity, moment(each.made_s), until, ", ".join(each.hosts), each.serial
            )
        return table

    call.show(issued, lambda: draw() if issued else "No certificates yet.")


def _issue(
    call: Call,
    folder: Path | None,
    identities: list[Identity],
    days: int,
    connect: list[str] | None,
    hosts: list[str] | tuple[str, ...] = (),
    listen: list[str] | tuple[str, ...] = (),
) -> None:
    from cli.certificates.identity import Kind
    from cli.errors import BadArgument
    from cli.settings import endpoints

    authority = authority_of(call, folder)
    routers = endpoints(connect, "--connect")
    listens = endpoints(list(listen) or None, "--listen", listens=True)
    for endpoint in (*routers, *listens):
        if not endpoint.startswith("tls/"):
            protocol, _, address = endpoint.partition("/")
            raise BadArgument(
                f"certificates are for TLS, and {endpoint} is {protocol}: write tls/{address}"
            )
    held = {each.identity for each in authority.issued() if not each.revoked}
    for identity in identities:
        if str(identity) in held:
            more = "; another router has another --name" if identity.kind is Kind.ROUTER else ""
            call.warn(
                f"the certificate of {identity} that there was is replaced, and believed until it "
                f"expires or `robotctl certs revoke {identity} --replaced` revokes it{more}"
            )
    made = {
        str(identity): authority.issue(
            identity, hosts, days, connect=routers, listen=listens
        ).settings
        for identity in identities
    }
    call.show(
        {name: str(path) for name, path in made.items()},
        lambda: "\n".join(
            f"{name}: --zenoh-config {path} (with the .pem and .key beside it, and ca.pem)"
            for name, path in made.items()
        ),
    )
    renew_access(call, authority)


def renew_access(call: Call, authority: Authority) -> None:
    """Write the access control anew where it has changed, and say what is to be done with it."""
    for path in authority.renew_access():
        call.warn(
            f"who may do what in {path.name} is written anew, and Zenoh reads it when it starts: "
            f"{_started_again(call, path)}"
        )


def _started_again(call: Call, settings: Path) -> str:
    """How the router of a Zenoh configuration is started again."""
    from cli.certificates.fleet_certificates import PROCESSES
    from cli.processes.composition import ROUTER
    from cli.processes.up_state import running_state, state_folder

    up = running_state(state_folder(call.settings.realm))
    if (
        up is not None
        and up.zenoh_config is not None
        and Path(up.zenoh_config).parent == settings.parent.absolute()
        and settings.stem == PROCESSES[ROUTER].file_name
    ):
        for child in up.children:
            if child.name == ROUTER and child.process is not None:
                pid = child.process.pid
                return f"`kill {pid}`, after which `robotctl up` starts its router again"
    return (
        "put it on the router's host, and start the router again "
        f"(`robotctl router --zenoh-config {settings.name}`)"
    )


def authority_of(call: Call, folder: Path | None) -> Authority:
    """The authority in a folder, or in the realm's own.

    Raises:
        BadCertificates: there is none.
    """
    from cli.certificates.authority import Authority

    return Authority(folder_of(call, folder))


def folder_of(call: Call, given: Path | None) -> Path:
    """Where an authority is: `given`, else the realm's own."""
    from cli.processes.data_folder import data_folder

    return data_folder(given, "certs", call.settings.realm)
