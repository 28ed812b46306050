"""What all commands share: global options in any position, a session, output, and errors.

A command is a function whose first parameter is a `Call`. `@command(app)` registers it with the
global options added, so that `robotctl robots --json` and `robotctl --json robots` are the same.
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cli.command_line import Command, Group
from cli.errors import CliError, TooLate
from cli.settings import Settings, load_settings
from cli.terminal import json_text, keep_on

if TYPE_CHECKING:
    from rich.console import RenderableType

    from keyexpr_schema.principals import Principal
    from keyexpr_schema.transport.session import Session

CONNECT_TIMEOUT_S = 1.5
"""With the time that Python takes to start, less than the 3 s within which robotctl must say that
there is no router."""

DAEMONS = ("router", "planner", "worker", "sim", "record", "up", "demo")
"""What goes on when nobody reads any more what it prints."""
_OURS = ("cli", "keyexpr_schema", "fleet", "sim", "workers")

RouterOption = Annotated[
    list[str] | None,
    typer.Option("--router", metavar="ENDPOINT", help="Zenoh router; may be repeated."),
]
RealmOption = Annotated[
    str | None, typer.Option("--realm", metavar="NAME", help="Which fleet on that router.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print data as JSON on stdout.")]
AsOption = Annotated[
    str | None,
    typer.Option(
        "--as", metavar="WHO", help="Who says so; else user@host. A certificate goes before."
    ),
]
ZenohOption = Annotated[
    Path | None,
    typer.Option("--zenoh-config", metavar="FILE", help="Zenoh's own settings: TLS, …"),
]


@dataclass(frozen=True)
class GlobalFlags:
    """Global options given before the subcommand."""

    routers: tuple[str, ...] = ()
    realm: str | None = None
    json: bool = False
    by: str | None = None
    zenoh_config: Path | None = None


@dataclass(frozen=True)
class Call:
    """One run of one command: its settings, and how it talks to the fleet and to the person."""

    settings: Settings

    @property
    def interactive(self) -> bool:
        """Whether somebody sits at a terminal who can be asked back."""
        return not self.json and sys.stdin.isatty() and sys.stderr.isatty()

    @property
    def json(self) -> bool:
        """Whether data goes to stdout as JSON."""
        return self.settings.json

    @property
    def principal(self) -> Principal | None:
        """Whom the certificate names that is used; None: none is."""
        if self.settings.zenoh is None:
            return None
        from keyexpr_schema.transport.credentials import of_client

        ours = of_client(self.settings.zenoh)
        return None if ours is None else ours.principal

    @property
    def by(self) -> str:
        """Who gives the command: the operator whose certificate is used, else who was said, else
        `user@host`."""
        who = self.principal
        if who is not None and who.author is not None:
            return who.author
        if self.settings.by is not None:
            return self.settings.by
        import getpass
        import socket

        try:
            user = getpass.getuser()
        except (KeyError, OSError):  # nobody has a name in a bare container
            user = "somebody"
        return f"{user}@{socket.gethostname()}"

    @asynccontextmanager
    async def session(
        self,
        component: str = "robotctl",
        connect_timeout_s: float = CONNECT_TIMEOUT_S,
        *,
        urgent: bool = False,
    ) -> AsyncIterator[Session]:
        """A session on the configured router; entering raises `Unreachable` if there is none, or no
        store behind it, and `ClockSkewed` where the clock of this host is off.

        `urgent`: neither store nor clock is asked for. Where something is waited for in vain in
        the block, what is wrong with the fleet is said.
        """
        from keyexpr_schema.errors import Unreachable
        from keyexpr_schema.transport.session import SessionConfig, open_session

        if self.settings.by is not None and self.by != self.settings.by:
            self.warn(
                f"Warning: this is said by {self.by!r}, whose certificate is used, and not by "
                f"{self.settings.by!r}"
            )
        config = SessionConfig(
            endpoints=self.settings.routers,
            realm=self.settings.realm,
            component=component,
            connect_timeout_s=connect_timeout_s,
            by=self.by,
            urgent=urgent,
            zenoh_config=self.settings.zenoh,
        )
        async with open_session(config) as session:
            # Empty is not absent: without a store there would seem to be nothing.
            if not (urgent or session.clock.latest or await session.store_present()):
                raise Unreachable.no_store(self.settings.routers)
            try:
                yield session
            except TooLate as error:
                from cli.client.health import diagnostics

                wrong = await diagnostics(session)
                said = (str(error), *(f"{each.component}: {each.sentence}" for each in wrong))
                raise TooLate("; ".join(said)) from None

    def show(self, data: object, draw: Callable[[], RenderableType]) -> None:
        """Print `data` (payloads, or containers of them) as JSON, with its times in ISO 8601 beside
        them, or what `draw` makes of it."""
        if self.json:
            import msgspec

            from cli.times import with_iso

            plain = msgspec.to_builtins(data, str_keys=True, enc_hook=_encode)
            encoded = msgspec.json.encode(with_iso(plain))
            typer.echo(json_text(msgspec.json.format(encoded, indent=2)))
            return
        drawn = draw()
        if isinstance(drawn, str):
            typer.echo(drawn)
        else:
            from cli.views.console import console

            console().print(drawn)

    def inform(self, sentence: str) -> None:
        """A sentence for a person: on stdout, or on stderr where stdout carries JSON."""
        typer.echo(sentence, err=self.json)

    def warn(self, sentence: str) -> None:
        """A sentence for a person, on stderr."""
        typer.echo(sentence, err=True)


Body = Callable[..., Coroutine[Any, Any, None] | None]


def group(about: str) -> typer.Typer:
    """A command with subcommands; `about` is its help."""
    return typer.Typer(
        cls=Group, help=about, no_args_is_help=True, rich_markup_mode=None, add_completion=False
    )


def single(body: Body) -> typer.Typer:
    """`body(call, …)` as a command without subcommands."""
    app = typer.Typer(rich_markup_mode=None, add_completion=False)
    command(app)(body)
    return app


def command(
    app: typer.Typer, name: str | None = None, cls: type[Command] = Command
) -> Callable[[Body], Body]:
    """Register `body(call, …)`, plain or async, as a command of `app` with the global options."""

    def register(body: Body) -> Body:
        app.command(name, cls=cls)(_with_global_options(body))
        return body

    return register


def without_command(app: typer.Typer) -> Callable[[Body], Body]:
    """Register `body(call, …)` as what the group `app` does where none of its commands is named."""

    def register(body: Body) -> Body:
        app.callback(invoke_without_command=True)(_with_global_options(body))
        app.info.no_args_is_help = False
        return body

    return register


def _with_global_options(body: Body) -> Callable[..., None]:
    """`body` as typer runs it: with the global options, which become its `Call`."""
    signature = inspect.signature(body, eval_str=True)
    own = list(signature.parameters.values())[1:]
    says_as = any("--as" in _flags(parameter) for parameter in own)  # it means something else here

    @functools.wraps(body)
    def run(
        *,
        ctx: typer.Context,
        router: list[str] | None = None,
        realm: str | None = None,
        json: bool = False,
        by_whom: str | None = None,
        zenoh_config: Path | None = None,
        **arguments: object,
    ) -> None:
        before = ctx.obj if isinstance(ctx.obj, GlobalFlags) else GlobalFlags()
        flags = GlobalFlags(
            routers=tuple(router or before.routers),
            realm=realm or before.realm,
            json=json or before.json,
            by=before.by if by_whom is None else by_whom,
            zenoh_config=zenoh_config or before.zenoh_config,
        )
        if ctx.invoked_subcommand is not None:
            ctx.obj = flags
            return
        with one_sentence_errors():
            if body.__name__ in DAEMONS:
                keep_on()
            settings = load_settings(
                list(flags.routers),
                flags.realm,
                flags.json,
                by=flags.by,
                zenoh_config=flags.zenoh_config,
            )
            if settings.limits:
                from keyexpr_schema.limits import Limits, put_in_force

                put_in_force(Limits(**settings.limits))
            outcome = body(Call(settings), **arguments)
            if inspect.iscoroutine(outcome):
                import asyncio

                asyncio.run(outcome)

    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        *(parameter.replace(kind=keyword) for parameter in own),
        inspect.Parameter("router", keyword, default=None, annotation=RouterOption),
        inspect.Parameter("realm", keyword, default=None, annotation=RealmOption),
        inspect.Parameter("json", keyword, default=False, annotation=JsonOption),
        inspect.Parameter("zenoh_config", keyword, default=None, annotation=ZenohOption),
    ]
    if not says_as:
        parameters.append(inspect.Parameter("by_whom", keyword, default=None, annotation=AsOption))
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _flags(parameter: inspect.Parameter) -> tuple[str, ...]:
    """The option names of a command's parameter; in `Annotated` the first counts as a default."""
    declared = getattr(parameter.annotation, "__metadata__", ())
    names = ((each.default, *(each.param_decls or ())) for each in declared)
    return tuple(name for each in names for name in each if isinstance(name, str))


class one_sentence_errors:  # noqa: N801 - used like a function, as contextlib's are
    """What goes wrong in the domain is a sentence on stderr and exit code 1, not a traceback."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None or isinstance(error, typer.Exit):
            return
        found = next((each for each in _leaves(error) if _of_the_domain(each)), None)
        if found is not None:
            # Some libraries print to a buffered stdout; keep what was said before the error first.
            sys.stdout.flush()
            typer.echo(f"Error: {' '.join(sentence_of(found).split())}", err=True)
            raise typer.Exit(1) from None


def _leaves(error: BaseException) -> list[BaseException]:
    """The errors inside a (nested) group, as a TaskGroup raises them."""
    if isinstance(error, BaseExceptionGroup):
        return [leaf for each in error.exceptions for leaf in _leaves(each)]
    return [error]


def _of_the_domain(error: BaseException) -> bool:
    """Whether the error is one that a package of ours declares, or the system's refusal.

    Told by the module a class was defined in, so that no package is imported only to ask.
    """
    declared = {kind.__module__ for kind in type(error).__mro__}
    if isinstance(error, BrokenPipeError):
        return False  # `robotctl … | head`: typer ends quietly
    return isinstance(error, OSError) or any(
        module.split(".")[0] in _OURS and module.endswith(".errors") for module in declared
    )


def sentence_of(error: BaseException) -> str:
    """What went wrong, for a person; the system's own words name neither subject nor verb."""
    if isinstance(error, OSError) and error.strerror:
        what = f"{error.filename} cannot be used" if error.filename else "it cannot be done"
        no_folder = isinstance(error, FileExistsError)
        return f"{what}: {'it is a file, and a folder is meant' if no_folder else error.strerror}"
    return str(error)


def _encode(value: object) -> object:
    raise CliError(f"cannot show a {type(value).__name__} as JSON")
