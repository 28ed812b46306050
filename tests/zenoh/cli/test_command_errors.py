"""What cannot be, as robotctl says it: one sentence, and an exit code."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cli.command import CONNECT_TIMEOUT_S
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOTS = [str(CONFIGS / "robots" / f"{name}.yaml") for name in ("hsr", "locobot")]
WORLD = str(CONFIGS / "worlds" / "home.yaml")


@pytest.fixture(scope="module")
def shared_router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RouterProcess]:
    """One for all of these: nothing that is refused is stored."""
    process = RouterProcess(tmp_path_factory.mktemp("router"))
    try:
        yield process
    finally:
        process.kill()


@pytest.fixture
def robotctl(shared_router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(shared_router.endpoint, tmp_path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["plan", "create", "big-dag", "milp"], "no planner is running; start one with"),
        (["plan", "create", "big-dag", "milp", "g"], "there is no goal 'g': there is none now"),
        (["plan", "show"], "there is no plan yet; make one with `robotctl plan create`"),
        (["plan", "start", "p"], "there is no plan 'p'"),
        (["replan", "p"], "there is no plan 'p'"),
        (["task", "list", "p"], "there is no plan 'p'"),
        (["task", "add", "p", "navigate", "place"], "'place' is not NAME=VALUE"),
        (["register", "nowhere.yaml"], "nowhere.yaml"),
        (["register", WORLD], "home.yaml"),
        (["world", "load", ROBOTS[0]], "hsr.yaml"),
        (["goal", "add", " "], "say what you want, such as “Bring the first cup"),
        (["goal", "add", "x", "--id", ""], "goal '' is not valid: use 1 to 63 ASCII letters"),
        (["goal", "add", "x", "--id", "a/**"], "goal 'a/**' is not valid: use 1 to 63 ASCII"),
        (
            ["goal", "add", "x", "--before", "at cup_1 kitchen"],
            "is 'CONDITION before CONDITION', such as 'is_open fridge false before at cup_1",
        ),
        (
            ["goal", "add", "x", "--before", "at cup_1 before at cup_1 kitchen"],
            "a condition is RELATION SUBJECT VALUE, such as 'is_open fridge false'; got 'at cup_1'",
        ),
        (["world", "add", ""], "say something, such as “The first cup is in the kitchen.”"),
        (["plan", "create", "big-dag", "milp", "--id", "a/b"], "plan 'a/b' is not valid: use 1"),
        (["goal", "delete", "g", "--ended"], "or say --ended for all that have ended; one of both"),
        (["goal", "delete", "--older-than", "5d"], "--older-than goes with --ended"),
        (["plan", "delete", "p", "--ended"], "or say --ended for all that have ended; one of both"),
        (["demo", "three-cups"], "there is no mission 'three-cups'; there are"),
        (["demo", "two-cups", "--backend", "bullet"], "known are: kinematic, mujoco"),
        (["sim", "two-cups", "--speed", "fast"], "neither 'max' nor a number above 0"),
        (["worker", "hsr", "--embodiment", "ghost"], "there is no embodiment 'ghost'"),
        (["--realm", "a b", "robots"], "'a b' is not a realm"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_exit_code_1(
    robotctl: Robotctl, arguments: list[str], words: str
) -> None:
    said = robotctl(*arguments)
    assert said.code == 1
    assert said.out == ""
    assert words in said.err
    assert said.err.startswith("Error: ")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["two-cups", "--backend", "bullet"], "there is no backend 'bullet'; known are: "),
        (["three-cups"], "there is no mission 'three-cups'; there are"),
        (["--robots", "hsr", "hsr"], "two of the files are of a robot 'hsr'"),
    ],
)
def test_what_cannot_be_up_is_told_before_anything_is_started(
    robotctl: Robotctl, arguments: list[str], words: str
) -> None:
    said = robotctl("up", *arguments, "--detach")
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith(f"Error: {words}")
    assert not list(robotctl.folder.rglob("up.log"))


@pytest.mark.parametrize("process", [["planner"], ["worker", "hsr"], ["router"]])
def test_a_data_directory_that_cannot_be_used_is_one_sentence(
    robotctl: Robotctl, process: list[str]
) -> None:
    file = robotctl.folder / "file"
    file.touch()
    for folder in (file, file / "below", Path("/proc/x")):
        said = robotctl(*process, "--data", str(folder))
        assert said.code == 1
        assert f"directory {folder} cannot be used: " in said.err
        assert "name one that can be written with --data" in said.err
        assert said.err.count("\n") == 1


def test_a_file_that_cannot_be_written_is_one_sentence(robotctl: Robotctl) -> None:
    said = robotctl("demo", "two-cups", "--out", "/proc/x")
    assert said.code == 1
    assert said.err.endswith("\nError: /proc/x cannot be used: No such file or directory\n")


def test_usage_errors_exit_with_2_and_suggest(robotctl: Robotctl) -> None:
    typo = robotctl("robtos")
    assert typo.code == 2
    assert "Did you mean 'robots'?" in typo.err
    nested = robotctl("goal", "lits")
    assert nested.code == 2
    assert "Did you mean 'list'?" in nested.err
    assert robotctl("goal", "add").code == 2
    none_kept = robotctl("record", "out.rrd", "--roll-every", "90s", "--keep", "0")
    assert none_kept.code == 2
    assert "'--keep'" in none_kept.err


def test_without_a_router_it_says_one_sentence_soon(tmp_path: Path) -> None:
    """Within 3 s; benchmarks/bench_startup.py measures that, as a busy machine takes any time."""
    robotctl = Robotctl("tcp/127.0.0.1:1", tmp_path)
    said = robotctl("robots", "--json")
    assert said.code == 1
    assert said.out == ""
    assert said.err.startswith("Error: no router answers at tcp/127.0.0.1:1")
    assert said.err.count("\n") == 1
    assert CONNECT_TIMEOUT_S <= 1.5  # the rest is for Python to start
