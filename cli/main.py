"""`robotctl`: the command line of the fleet.

Only typer is imported here, and a subcommand's module only when it is called: that keeps
`robotctl --help` instant.
"""

from __future__ import annotations

import importlib
import sys
from typing import Annotated, Any

import typer
import typer.core
import typer.main

from cli import terminal
from cli.command import (
    AsOption,
    GlobalFlags,
    JsonOption,
    RealmOption,
    RouterOption,
    ZenohOption,
    sentence_of,
)
from cli.command_line import Group


def _say_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"robotctl {version('robotfleet-zenoh')}")
        raise typer.Exit


VersionOption = Annotated[
    bool,
    typer.Option("--version", is_eager=True, callback=_say_version, help="Which version it is."),
]

COMMANDS: dict[str, tuple[str, str]] = {
    "status": ("cli.commands.overview:status", "The whole fleet on one page."),
    "health": ("cli.commands.health:health", "Whether a process, or the fleet, is well."),
    "watch": ("cli.commands.overview:watch", "Follow goals, plans and tasks as they change."),
    "why": ("cli.commands.why:why", "Why something waits, runs, or has ended."),
    "goal": ("cli.commands.goals:app", "Say what you want, in a sentence; see what became of it."),
    "schedule": ("cli.commands.schedules:app", "What is wanted again and again, or later."),
    "ask": ("cli.commands.questions:ask", "Ask where things are, what is so, who does what."),
    "plan": ("cli.commands.plans:app", "Make, look at, check, compare, start and cancel plans."),
    "task": ("cli.commands.tasks:app", "Look at tasks, or add one to a plan."),
    "tasks": ("cli.commands.named_tasks:tasks", "What goals can call by a name of its own."),
    "replan": ("cli.commands.plans:replan", "Plan again from what is known now."),
    "world": ("cli.commands.world:app", "Places, objects, facts and statements."),
    "stop": ("cli.commands.stops:stop", "Emergency stop: robots come to rest, and stay there."),
    "pause": ("cli.commands.stops:pause", "No new orders for robots, plans, or the whole fleet."),
    "resume": ("cli.commands.stops:resume", "End stops and pauses; work goes on from the facts."),
    "drain": ("cli.commands.stops:drain", "Take a robot out: others do what it was to do."),
    "return": ("cli.commands.stops:return_", "Put a drained robot back."),
    "robots": ("cli.commands.robots:robots", "Every robot: what it can do, and is doing."),
    "durations": (
        "cli.commands.robots:durations",
        "How long each type of robot really takes.",
    ),
    "register": ("cli.commands.robots:register", "Declare robots from YAML files."),
    "unregister": ("cli.commands.robots:unregister", "Take a robot out of the fleet for good."),
    "deploy": ("cli.commands.deploy:deploy", "Run a robot's worker as a container."),
    "undeploy": ("cli.commands.deploy:undeploy", "End what `deploy` runs for a robot."),
    "history": ("cli.commands.history:app", "What is over, and what came of it."),
    "audit": ("cli.commands.history:audit", "Who did what, in a log that only grows."),
    "journal": ("cli.commands.journal:journal", "What changed, in the order it was stored."),
    "demo": ("cli.commands.demo:demo", "Run a whole mission here, judged by the physics."),
    "store": ("cli.commands.store:app", "Put the router's store right, on its host."),
    "certs": ("cli.commands.certs:app", "Who may connect, and as whom: certificates for TLS."),
    "acl": ("cli.commands.acl:acl", "Who may do what: access control for routers."),
    "init": ("cli.commands.init:init", "Put configuration to edit into a folder."),
    "up": ("cli.commands.up:up", "Start a whole fleet on this machine, and keep it up."),
    "ps": ("cli.commands.up:ps", "The processes that `up` runs."),
    "logs": ("cli.commands.up:logs", "What a process of `up`, or a deployed worker, has printed."),
    "down": ("cli.commands.up:down", "End what `up` runs, in order."),
    "router": ("cli.commands.processes:router", "Run a Zenoh router with the fleet's store."),
    "planner": ("cli.commands.processes:planner", "Run the planner."),
    "worker": ("cli.commands.worker:worker", "Run one robot's worker."),
    "fence": ("cli.commands.fence:fence", "From which planner epoch on a robot takes orders."),
    "sim": ("cli.commands.processes:sim", "Run a simulated world."),
    "record": ("cli.commands.processes:record", "Record everything for Rerun."),
}
"""Name of each command: where its typer app is, and its line in `robotctl --help`."""


class LazyGroup(Group):
    """Knows its commands by name and help line, and imports one when it is about to run."""

    def __init__(self, **attrs: Any) -> None:
        super().__init__(**attrs)
        for name, (_, line) in COMMANDS.items():
            self.add_command(
                typer.core.TyperCommand(name=name, help=line, rich_markup_mode=None, callback=None)
            )

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Put the real command in the place of its help line, then resolve as usual."""
        if args and args[0] in COMMANDS:
            module, _, attribute = COMMANDS[args[0]][0].partition(":")
            app = getattr(importlib.import_module(module), attribute)
            self.commands[args[0]] = typer.main.get_command(app)
        return super().resolve_command(ctx, args)

    def elsewhere(self, name: str) -> list[str]:
        """Commands of the groups below that are called so."""
        found = []
        for group, (where, _) in COMMANDS.items():
            module, _, attribute = where.partition(":")
            if attribute == "app":
                below = typer.main.get_command(getattr(importlib.import_module(module), attribute))
                found += [
                    f"{group} {each}" for each in getattr(below, "commands", ()) if each == name
                ]
        return found


app = typer.Typer(
    cls=LazyGroup,
    name="robotctl",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def root(
    ctx: typer.Context,
    router: RouterOption = None,
    realm: RealmOption = None,
    json: JsonOption = False,
    by_whom: AsOption = None,
    zenoh_config: ZenohOption = None,
    version: VersionOption = False,
) -> None:
    """Command a mixed fleet of robots in plain language, over Zenoh.

    --router, --realm, --as, --zenoh-config and --json go before or after the command. Their values
    come from the flag, else from ROBOTFLEET_ROUTER, ROBOTFLEET_REALM and so on, else from
    robotctl.yaml, else from what `robotctl up` runs here, else from the defaults
    (tcp/127.0.0.1:7447, robotfleet, user@host). Exit codes: 0 done, 1 it failed (one sentence on
    stderr says why), 2 the command line is wrong.
    """
    ctx.obj = GlobalFlags(
        routers=tuple(router or ()),
        realm=realm,
        json=json,
        by=by_whom,
        zenoh_config=zenoh_config,
    )


def main() -> None:
    """Entry point of the `robotctl` script."""
    terminal.prepare()
    if (argument := terminal.unreadable(sys.argv[1:])) is not None:
        typer.echo(
            f"Error: the argument {argument} is no UTF-8 text; type it again, as UTF-8", err=True
        )
        raise SystemExit(2)
    try:
        app(prog_name="robotctl")
    except OSError as error:  # of help and the like, which are printed outside of any command
        typer.echo(f"Error: {sentence_of(error)}", err=True)
        raise SystemExit(1) from None


if __name__ == "__main__":
    main()
