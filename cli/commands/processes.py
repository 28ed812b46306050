"""`robotctl router`, `planner`, `sim`, `record`: the processes a fleet is made of.

Each is a thin wrapper: it imports the process's own package when it is called, and runs it until
SIGINT or SIGTERM.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from cli.arguments import MissionArgument
from cli.command import Call, single
from cli.processes.data_folder import data_folder
from cli.settings import DEFAULT_ROUTER, LEAST_PLANNING_LIMIT_S, endpoints

T = TypeVar("T")
BackendOption = Annotated[
    str, typer.Option("--backend", help="mujoco (physics) or kinematic (fast, no physics).")
]
SpeedOption = Annotated[
    str, typer.Option("--speed", help="Of a simulated world: its seconds in a second, or max.")
]
DataOption = Annotated[
    Path | None,
    typer.Option(
        "--data", metavar="DIR", help="Where it keeps what must last; else in ~/.local/share."
    ),
]


@single
def router(
    call: Call,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            "--listen", metavar="ENDPOINT", help="Default: where robotctl looks for a router."
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option("--connect", metavar="ENDPOINT", help="Other routers to link with."),
    ] = None,
    data: DataOption = None,
    store: Annotated[
        bool | None,
        typer.Option(
            "--store/--no-store",
            help="Whether it keeps the fleet's store, as one router of all that are linked does; "
            "else only without --connect.",
        ),
    ] = None,
    journal_entries: Annotated[
        int | None,
        typer.Option("--journal-entries", min=1, help="Changes its journal keeps: 100000."),
    ] = None,
    journal_mb: Annotated[
        float | None,
        typer.Option("--journal-mb", min=0.01, metavar="MB", help="And of how many MB: 32."),
    ] = None,
    journal_days: Annotated[
        float | None,
        typer.Option("--journal-days", min=0.01, metavar="DAYS", help="And for how long: 30."),
    ] = None,
    tombstones: Annotated[
        int | None,
        typer.Option("--tombstones", min=0, metavar="N", help="Deletions it remembers: 50000."),
    ] = None,
    tombstone_days: Annotated[
        float | None,
        typer.Option(
            "--tombstone-days",
            min=0.01,
            metavar="DAYS",
            help="And for how long, against older values that come late: 7.",
        ),
    ] = None,
) -> None:
    """Run a Zenoh router with the fleet's durable store in it, or beside one that has it."""
    from cli.errors import BadArgument
    from cli.processes.child_processes import end_with_parent
    from fleet.service.router_process import run
    from fleet.stores import StoreMemory

    given = {
        "journal_entries": journal_entries,
        "journal_mb": journal_mb,
        "journal_days": journal_days,
        "tombstones": tombstones,
        "tombstone_days": tombstone_days,
    }
    memory = StoreMemory(**{name: value for name, value in given.items() if value is not None})  # type: ignore[arg-type]

    settings = call.settings
    file = None if settings.of_up else settings.zenoh
    if file is not None and file.lets_all_do_all:
        call.warn(
            f"{file.path} has no access control: whoever has a certificate may do everything; "
            "`robotctl acl` prints what to put there"
        )
    links = endpoints(connect, "--connect") or (() if file is None else file.connects("router"))
    keeps = not links if store is None else store
    if not keeps and (data is not None or any(value is not None for value in given.values())):
        why = "a router that is linked with others keeps none" if store is None else "--no-store"
        raise BadArgument(
            f"{why}: leave out --data and how much is kept, or say --store where this router keeps "
            "the store of them all"
        )
    end_with_parent()
    run(
        # Not where a router is found that runs: what `up` has there is another one.
        listen=endpoints(listen, "--listen", listens=True)
        or (() if file is None else file.listens())
        or (settings.routers[:1] if settings.said else (DEFAULT_ROUTER,)),
        connect=links,
        data_dir=data_folder(data, "router") if keeps else None,
        memory=memory,
        file=file,
    )


@single
def planner(
    call: Call,
    data: DataOption = None,
    skills: Annotated[
        list[Path] | None,
        typer.Option(
            "--skills",
            metavar="FILE",
            help="Models of more skills than the household's; repeatable.",
        ),
    ] = None,
    tasks: Annotated[
        list[Path] | None,
        typer.Option(
            "--tasks",
            metavar="FILE",
            help="More tasks that goals can name than the household's; repeatable.",
        ),
    ] = None,
    words: Annotated[
        list[Path] | None,
        typer.Option(
            "--words",
            metavar="FILE",
            help="Words of your own, beside those that goals can be said in; repeatable.",
        ),
    ] = None,
    llm_config: Annotated[
        Path | None,
        typer.Option(
            "--llm-config",
            metavar="FILE",
            help="Configures planning by language model; else configs/planner.yaml, if there.",
        ),
    ] = None,
    approval: Annotated[
        bool | None,
        typer.Option("--approval/--no-approval", help="A person approves each new plan."),
    ] = None,
    auto_plan: Annotated[
        bool | None,
        typer.Option("--auto-plan/--no-auto-plan", help="Goals that wait are planned unasked."),
    ] = None,
    lost_after_s: Annotated[
        float | None,
        typer.Option(
            "--lost-after",
            metavar="SECONDS",
            min=0.0,
            help="A robot whose worker is gone for longer is lost; else 30.",
        ),
    ] = None,
    lease_s: Annotated[
        float | None,
        typer.Option(
            "--lease",
            metavar="SECONDS",
            min=0.0,
            help="A robot that hears nothing of the planner for longer rests; else 8. 0: never.",
        ),
    ] = None,
    keep_days: Annotated[
        float | None,
        typer.Option(
            "--keep-days",
            metavar="DAYS",
            min=0.0,
            help="How long what is over keeps its keys; else 7. `history` keeps it for good.",
        ),
    ] = None,
    keep: Annotated[
        int | None,
        typer.Option(
            "--keep",
            metavar="N",
            min=0,
            help="Of no more than so many ended plans, though; else 200.",
        ),
    ] = None,
    planning_limit_s: Annotated[
        float | None,
        typer.Option(
            "--planning-limit",
            metavar="SECONDS",
            min=LEAST_PLANNING_LIMIT_S,
            help="A plan is made within that time; goals that take longer wait. Else 120.",
        ),
    ] = None,
) -> None:
    """Run the planner: it turns goals into plans and has them carried out.

    What no flag says comes from `planner:` in robotctl.yaml.
    """
    from cli.processes.child_processes import end_with_parent
    from fleet.core.state import Policy
    from fleet.history.retention import Retention
    from fleet.service.leases import LEASE_S, check_lease
    from fleet.service.planner_process import run

    settings, default, kept = call.settings.planner, Policy(), Retention()
    lost = _first(lost_after_s, settings.lost_after_s, default.lost_after_s)
    lease = _first(lease_s, settings.lease_s, LEASE_S)
    check_lease(lease, lost)
    end_with_parent()
    run(
        endpoints=call.settings.routers,
        realm=call.settings.realm,
        zenoh_config=call.settings.zenoh_config,
        data_dir=data_folder(data, "planner", call.settings.realm),
        skill_files=tuple(skills or settings.skills),
        task_files=tuple(tasks or settings.tasks),
        word_files=tuple(words or settings.words),
        llm_file=llm_config or settings.llm_config,
        policy=Policy(
            approval=_first(approval, settings.approval, default.approval),
            auto_plan=_first(auto_plan, settings.auto_plan, default.auto_plan),
            lost_after_s=lost,
            lease_s=lease,
            planning_limit_s=_first(
                planning_limit_s, settings.planning_limit_s, default.planning_limit_s
            ),
        ),
        retention=Retention(
            days=_first(keep_days, settings.keep_days, kept.days),
            count=_first(keep, settings.keep, kept.count),
        ),
    )


@single
def sim(
    call: Call,
    mission: MissionArgument,
    backend: BackendOption = "mujoco",
    speed: SpeedOption = "1",
    spread: Annotated[
        float,
        typer.Option(
            "--spread", min=0.0, help="Kinematic: how much durations vary (0.2: about a fifth)."
        ),
    ] = 0.0,
    failing: Annotated[
        float,
        typer.Option("--failing", min=0.0, max=1.0, help="Kinematic: share of grasps that fail."),
    ] = 0.0,
    seed: Annotated[int, typer.Option("--seed", help="Of everything that is drawn.")] = 0,
) -> None:
    """Run a simulated world with a mission's robots in it."""
    from cli.errors import BadArgument, check_known
    from cli.processes.child_processes import end_with_parent
    from sim.kinematic.backend import MotionModel
    from sim.server.process import BACKENDS, run_simulation

    check_known("backend", backend, BACKENDS)
    pace = parse_speed(speed)
    if backend != "kinematic" and (spread or failing):
        raise BadArgument("--spread and --failing are for --backend kinematic; physics needs none")

    end_with_parent()
    run_simulation(
        mission=mission,
        endpoints=call.settings.routers,
        realm=call.settings.realm,
        zenoh_config=call.settings.zenoh_config,
        backend=backend,
        speed=pace,
        seed=seed,
        motion_model=MotionModel(spread=spread, failure_chance={"grasp": failing}),
    )


@single
def record(
    call: Call,
    out: Annotated[Path, typer.Argument(metavar="OUT.rrd", help="The recording.")],
    view: Annotated[bool, typer.Option("--view", help="Show it live in Rerun, too.")] = False,
    roll_every: Annotated[
        str | None,
        typer.Option(
            metavar="TIME|SIZE",
            help="Begin a new file, OUT-0001.rrd and so on, every 30min, 2h, 500MB or 2GB.",
        ),
    ] = None,
    keep: Annotated[
        int | None,
        typer.Option(
            "--keep", metavar="N", min=1, help="With --roll-every: keep so many files, the latest."
        ),
    ] = None,
) -> None:
    """Record everything that happens for Rerun."""
    # Read when Rerun is imported; it would warn, of each file, that it has no table of contents.
    os.environ.setdefault("RUST_LOG", "error")
    from cli.errors import BadArgument
    from cli.processes.child_processes import end_with_parent
    from fleet.timeline.process import run_recorder
    from fleet.timeline.rolling import BadRolling, parse_rolling

    if keep is not None and roll_every is None:
        raise BadArgument("--keep is for recordings that roll; say --roll-every, too")
    if view and roll_every is not None:
        raise BadArgument("--view shows one recording; leave out --roll-every")
    try:
        rolls = None if roll_every is None else parse_rolling(roll_every, keep)
    except BadRolling as error:
        raise BadArgument(f"--roll-every: {error}") from None
    end_with_parent()
    run_recorder(
        endpoints=call.settings.routers,
        realm=call.settings.realm,
        zenoh_config=call.settings.zenoh_config,
        out=out,
        view=view,
        rolling=rolls,
    )


def parse_speed(written: str) -> float | None:
    """`max` (`None`) or a number above 0.

    Raises:
        BadArgument: it is neither.
    """
    import math

    from cli.errors import BadArgument

    if written == "max":
        return None
    try:
        speed = float(written)
    except ValueError:
        speed = math.nan
    if not (math.isfinite(speed) and speed > 0.0):
        raise BadArgument(f"speed {written!r} is neither 'max' nor a number above 0")
    return speed


def _first(flag: T | None, setting: T | None, default: T) -> T:
    return next((each for each in (flag, setting) if each is not None), default)
