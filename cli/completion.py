"""What the shell completes names with: asked of the store, quickly, and silent where none answers.

Nothing is imported before somebody presses the tabulator: commands name these functions, and
robotctl starts at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

import typer

if TYPE_CHECKING:
    from keyexpr_schema.key import Key

CONNECT_S, ASK_S = 0.5, 1.0
"""Who waits for a completion has typed half a word [s, wall]."""

T = TypeVar("T")
Offered = list[tuple[str, str]]
"""Names, and what a shell that can shows beside each."""


def goals(ctx: typer.Context, incomplete: str) -> Offered:
    """Goals, with their words."""
    from keyexpr_schema.keyspace import GOAL_SPEC

    (told,) = _stored(ctx, GOAL_SPEC)
    return _offered(ctx, incomplete, ((a.goal, spec.text) for a, spec in told.items()))


def schedules(ctx: typer.Context, incomplete: str) -> Offered:
    """Schedules and goals for later, with how they stand."""
    from keyexpr_schema.keyspace import GOAL_STATUS, SCHEDULE_STATUS
    from keyexpr_schema.payloads.goals import GoalState

    known, wanted = _stored(ctx, SCHEDULE_STATUS, GOAL_STATUS)
    told = [(a.schedule, each.state.value) for a, each in known.items()]
    held = (GoalState.PENDING, GoalState.STANDING)
    goals = [(a.goal, each) for a, each in wanted.items() if each.state in held]
    later = [(name, each.state.value) for name, each in goals if each.whenever or each.next_s]
    return _offered(ctx, incomplete, {**dict(later), **dict(told)}.items())


def plans(ctx: typer.Context, incomplete: str) -> Offered:
    """Plans, with how they stand."""
    from keyexpr_schema.keyspace import PLAN_STATUS

    (told,) = _stored(ctx, PLAN_STATUS)
    return _offered(ctx, incomplete, ((a.plan, status.state.value) for a, status in told.items()))


def tasks(ctx: typer.Context, incomplete: str) -> Offered:
    """Tasks of the plan that was named before, with what each does."""
    from keyexpr_schema.keyspace import TASK_RECORD

    (told,) = _stored(ctx, TASK_RECORD, plan=ctx.params.get("plan"))
    return _offered(
        ctx, incomplete, ((a.task, f"{r.skill}, {r.state.value}") for a, r in told.items())
    )


def robots(ctx: typer.Context, incomplete: str) -> Offered:
    """Registered robots, with their models."""
    from keyexpr_schema.keyspace import ROBOT_SPEC

    (told,) = _stored(ctx, ROBOT_SPEC)
    return _offered(ctx, incomplete, ((a.robot, spec.model) for a, spec in told.items()))


def world_names(ctx: typer.Context, incomplete: str) -> Offered:
    """Statements, objects and places."""
    from keyexpr_schema.keyspace import OBJECT, PLACE, STATEMENT

    said, things, rooms = _stored(ctx, STATEMENT, OBJECT, PLACE)
    statements = [(a.statement, each.text) for a, each in said.items()]
    objects = [(a.object, each.label) for a, each in things.items()]
    places = [(a.place, each.label) for a, each in rooms.items()]
    return _offered(ctx, incomplete, [*statements, *objects, *places])


def regions(ctx: typer.Context, incomplete: str) -> Offered:
    """Places, doors and zones."""
    from keyexpr_schema.keyspace import PLACE, REGION

    rooms, others = _stored(ctx, PLACE, REGION)
    places = [(a.place, each.label) for a, each in rooms.items()]
    named = [(a.region, each.kind.value) for a, each in others.items()]
    return _offered(ctx, incomplete, [*places, *named])


def what_waits(ctx: typer.Context, incomplete: str) -> Offered:
    """Goals and plans, and the tasks of a plan that is named before a slash."""
    from keyexpr_schema.keyspace import GOAL_SPEC, PLAN_STATUS, TASK_RECORD

    plan, slash, _ = incomplete.partition("/")
    if slash:
        (records,) = _stored(ctx, TASK_RECORD, plan=plan)
        tasks = [(f"{plan}/{a.task}", f"{r.skill}, {r.state.value}") for a, r in records.items()]
        return _offered(ctx, incomplete, tasks)
    wanted, made = _stored(ctx, GOAL_SPEC, PLAN_STATUS)
    goals = [(a.goal, spec.text) for a, spec in wanted.items()]
    plans = [(a.plan, status.state.value) for a, status in made.items()]
    return _offered(ctx, incomplete, [*goals, *plans])


def strategies(ctx: typer.Context, incomplete: str) -> Offered:
    """How the planner can bring goals together."""
    return _can(ctx, incomplete, "strategies")


def allocators(ctx: typer.Context, incomplete: str) -> Offered:
    """Who the planner can have choose the robots."""
    return _can(ctx, incomplete, "allocators")


def missions(ctx: typer.Context, incomplete: str) -> Offered:
    """Missions by name, one's own and those that are shipped."""
    return _files(ctx, "missions", incomplete)


def worlds(ctx: typer.Context, incomplete: str) -> Offered:
    """Worlds by name."""
    return _files(ctx, "worlds", incomplete)


def robot_files(ctx: typer.Context, incomplete: str) -> Offered:
    """Robots' files by name."""
    return _files(ctx, "robots", incomplete)


def roles(ctx: typer.Context, incomplete: str) -> Offered:
    """What `health` looks at."""
    from cli.client.health_checks import ROLES

    return _offered(ctx, incomplete, ((role, "") for role in ROLES))


def processes(ctx: typer.Context, incomplete: str) -> Offered:
    """The processes of the realm's `up`, with their logs."""
    from cli.processes.up_state import read_state, state_folder
    from cli.settings import load_settings

    def known() -> Offered:
        folder = state_folder(load_settings(None, _given(ctx, "realm"), False).realm)
        up = None if folder is None else read_state(folder)
        return [] if up is None else [(child.name, child.log) for child in up.children]

    return _offered(ctx, incomplete, _silently(known, []))


def _can(ctx: typer.Context, incomplete: str, what: str) -> Offered:
    from keyexpr_schema.keyspace import PLANNER_STATUS

    (told,) = _stored(ctx, PLANNER_STATUS)
    return _offered(ctx, incomplete, ((n, "") for s in told.values() for n in getattr(s, what)))


def _stored(ctx: typer.Context, *keys: Key[Any, Any], **fixed: str | None) -> list[dict[Any, Any]]:
    """What the store has under each of these keys; nothing where it does not say."""
    import asyncio

    from cli.settings import load_settings
    from keyexpr_schema.transport.session import SessionConfig, open_session

    def ask() -> list[dict[Any, Any]]:
        settings = load_settings(
            _given(ctx, "router"),
            _given(ctx, "realm"),
            False,
            zenoh_config=_given(ctx, "zenoh_config"),
        )
        config = SessionConfig(
            endpoints=settings.routers,
            realm=settings.realm,
            component="robotctl",
            connect_timeout_s=CONNECT_S,
            zenoh_config=settings.zenoh,
        )
        chunks: dict[str, Any] = {name: value for name, value in fixed.items() if value is not None}

        async def listed() -> list[dict[Any, Any]]:
            async with asyncio.timeout(CONNECT_S + ASK_S), open_session(config) as session:
                return [dict(await session.list(key, **chunks)) for key in keys]

        return asyncio.run(listed())

    return _silently(ask, [{} for _ in keys])


def _silently(ask: Callable[[], T], nothing: T) -> T:
    """What `ask` returns. No sentence of it can reach anybody: the shell shows what it is told."""
    try:
        return ask()
    except Exception:
        return nothing


def _files(ctx: typer.Context, kind: str, incomplete: str) -> Offered:
    from keyexpr_schema.config_files import config_folders

    found = (file for folder in config_folders(kind) for file in folder.glob("*.yaml"))
    names = {file.stem: str(file) for file in found if not file.stem.endswith(".model")}
    return _offered(ctx, incomplete, names.items())


def _given(ctx: typer.Context, name: str) -> Any:
    """The value of a global option, said after the command or before it."""
    at: Any = ctx
    while at is not None:
        if at.params.get(name):
            return at.params[name]
        at = at.parent
    return None


def _offered(ctx: typer.Context, incomplete: str, names: Iterable[tuple[str, str]]) -> Offered:
    """Those that begin so and were not said yet; each beside one line of words."""
    said = {
        word for value in ctx.params.values() if isinstance(value, list | tuple) for word in value
    }
    return sorted(
        (name, " ".join(words.split()))
        for name, words in names
        if name.startswith(incomplete) and name not in said
    )
