"""robotctl starts at once: it imports next to nothing until a command runs."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer.main

from cli.main import COMMANDS
from tests.support.polling import DEADLINE_S

HEAVY = (
    *("zenoh", "msgspec", "pydantic", "rich", "mujoco", "yaml", "rerun", "pulp", "numpy", "scipy"),
    "asyncio",
)
MODULES = 12
"""Beyond what `import typer` loads; ours and what its help page takes."""


def run_help(*options: str, command: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *options, "-m", "cli.main", *command, "--help"],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )


@pytest.mark.parametrize(
    "command",
    [(), ("goal",), ("goal", "add"), ("plan", "create"), ("status",), ("demo",), ("sim",)],
)
def test_help_imports_nothing_heavy(command: tuple[str, ...]) -> None:
    done = run_help("-X", "importtime", command=command)
    loaded = {line.rsplit("|", 1)[-1].strip() for line in done.stderr.splitlines()}
    assert "typer" in loaded
    roots = {name.split(".")[0] for name in loaded}
    assert not roots & set(HEAVY)
    assert not roots & {"keyexpr_schema", "fleet", "sim", "workers"}


def test_help_loads_little_beyond_typer() -> None:
    """What keeps it instant; how long it takes is measured by benchmarks/bench_startup.py."""

    def modules(*code: str) -> set[str]:
        done = subprocess.run(
            [sys.executable, "-X", "importtime", *code],
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        return {line.rsplit("|", 1)[-1].strip() for line in done.stderr.splitlines()}

    beyond = modules("-m", "cli.main", "--help") - modules("-c", "import typer")
    assert len(beyond) < MODULES


def test_what_shows_the_fleet_and_tells_it_loads_neither_grammar_nor_planner() -> None:
    """It takes as long to load as the rest of `status`, `goal add` or `register`."""
    code = (
        "import sys, cli.client.publish, cli.client.schedules, cli.errors, cli.overview.page\n"
        "import cli.times, cli.views.goals, cli.views.plans, cli.views.schedules, cli.views.tasks\n"
        "import cli.views.why, fleet.language.refusals, sim.files.robot_file\n"
        "import keyexpr_schema.transport.session, keyexpr_schema.transport.router\n"
        "print(*sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=DEADLINE_S
    )
    loaded = set(done.stdout.split())
    assert {"cli.overview.page", "fleet.language.refusals"} <= loaded
    assert not loaded & {"lark", "numpy", "fleet.core.state", "fleet.language.reader"}
    assert "cryptography" not in loaded  # that is for those who have certificates


def test_help_lists_every_command() -> None:
    page = run_help().stdout
    for name, (_, line) in COMMANDS.items():
        assert f"  {name} " in page
        assert line[:30] in page


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_there_and_takes_the_global_options(name: str) -> None:
    module, _, attribute = COMMANDS[name][0].partition(":")
    command = typer.main.get_command(getattr(importlib.import_module(module), attribute))
    leaves = list(getattr(command, "commands", {}).values()) or [command]
    for leaf in leaves:
        flags = {flag for parameter in leaf.params for flag in getattr(parameter, "opts", ())}
        assert {"--router", "--realm", "--json"} <= flags, leaf.name
        assert leaf.help, f"{name} {leaf.name} has no help"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("robotctl pl", {"plan", "planner"}),
        ("robotctl goal d", {"delete"}),
        ("robotctl goal add --prio", {"--priority"}),
    ],
)
def test_the_shell_completes(words: str, expected: set[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from cli.main import main; main()"],
        capture_output=True,
        text=True,
        timeout=120,
        env={
            **os.environ,
            "_ROBOTCTL_COMPLETE": "complete_bash",
            "COMP_WORDS": words,
            "COMP_CWORD": str(len(words.split()) - 1),
        },
    )
    assert set(done.stdout.split()) == expected


@pytest.mark.parametrize(
    ("command", "arguments", "priority"),
    [
        ("goals", ["list", "--router", "tcp/127.0.0.1:1"], None),
        ("goals", ["add", "Bring the first cup.", "--id", "g"], 0),
        ("plans", ["create", "big-dag", "milp", "g1", "g2"], None),
        ("goals", ["add", "Bring the first cup.", "--priority", "2", "--missed", "all"], 2),
    ],
)
def test_words_and_numbers_are_taken_without_pydantic(
    command: str, arguments: list[str], priority: int | None
) -> None:
    """It takes as long to load as the rest of a command; typer uses it for every value."""
    code = (
        f"import sys, typer.main, cli.commands.{command} as module\n"
        f"leaf = typer.main.get_command(module.app).commands[{arguments[0]!r}]\n"
        f"taken = leaf.make_context('robotctl', {arguments[1:]!r}).params\n"
        "print('pydantic' in sys.modules, list(taken['router']), taken.get('priority'))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=DEADLINE_S
    )
    router = ["tcp/127.0.0.1:1"] if "--router" in arguments else []
    assert done.stdout.strip() == f"False {router} {priority}"


@pytest.mark.parametrize(
    ("name", "arguments", "taken"),
    [
        ("planner", ["--data", "x"], {"data": Path("x"), "llm_config": None}),
        ("record", ["x.rrd"], {"out": Path("x.rrd")}),
        ("worker", ["hsr", "--data", "x"], {"data": Path("x")}),
        ("router", ["--data", "x"], {"data": Path("x")}),
    ],
)
def test_paths_are_taken_as_they_are_without_pydantic(
    name: str, arguments: list[str], taken: dict[str, object]
) -> None:
    """Every process of a fleet is given the folder of its data."""
    module, _, attribute = COMMANDS[name][0].partition(":")
    code = (
        f"import sys, typer.main, {module} as module\n"
        "from pathlib import Path, PosixPath\n"
        f"made = typer.main.get_command(module.{attribute}).make_context({name!r}, {arguments!r})\n"
        f"print('pydantic' in sys.modules, {{name: made.params[name] for name in {[*taken]}}} == "
        f"{taken!r})\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=DEADLINE_S
    )
    assert done.stdout == "False True\n"


def test_the_version_is_that_of_the_package() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "cli.main", "--version"], capture_output=True, text=True, timeout=120
    )
    assert (done.returncode, done.stdout) == (0, f"robotctl {version('robotfleet-zenoh')}\n")
