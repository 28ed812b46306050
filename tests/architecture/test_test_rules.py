"""The rules of the tests: public names only, no sleeping, no verdict by the clock."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.sources import tree_of

ROOT = Path(__file__).parents[2]
TESTS = sorted((ROOT / "tests").rglob("*.py"))
CLOCKS = {"monotonic", "perf_counter", "process_time", "monotonic_ns", "perf_counter_ns"}
SLEEPS = {
    "tests/support/polling.py": "between two looks at a condition",
    "tests/support/worker_world.py": "the world goes on by itself, a tick at a time",
    "tests/zenoh/cli/test_planner_by_robotctl.py": "a clock that ticks while a command runs",
    "tests/zenoh/timeline/test_timeline_recording.py": "a stream keeps its pace",
}
READS_CLOCK = {
    "tests/e2e/test_demo_two_cups.py": "what the demo says it took is no more than what it took",
    "tests/zenoh/sim/test_sim_server.py": "paced time is no faster than the wall under any load",
}


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def is_private(identifier: str) -> bool:
    return identifier.startswith("_") and not identifier.endswith("__")


def private_uses(tree: ast.AST) -> Iterator[str]:
    """Private names that are imported, or reached through anything but `self` and `cls`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            names = [*(node.module or "").split("."), *(alias.name for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [part for alias in node.names for part in alias.name.split(".")]
        elif isinstance(node, ast.Attribute):
            own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            names = [] if own else [node.attr]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("setattr", "getattr")):
            texts = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
            names = [part for text in texts for part in str(text).split(".")]
        else:
            continue
        for found in filter(is_private, names):
            yield f"line {node.lineno}: {found}"


def calls(tree: ast.AST, names: set[str]) -> bool:
    """Whether one of these functions is called, by its bare name or as an attribute."""
    called = (ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call))
    return any(function.rpartition(".")[2] in names for function in called)


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_a_test_uses_public_names_only(path: Path) -> None:
    assert list(private_uses(tree_of(path))) == []


@pytest.mark.parametrize(
    ("functions", "allowed"), [({"sleep"}, SLEEPS), (CLOCKS, READS_CLOCK)], ids=["sleep", "clock"]
)
def test_no_test_sleeps_or_goes_by_the_clock(functions: set[str], allowed: dict[str, str]) -> None:
    """Neither to be safe nor to judge; the exceptions say why, and go when they are over."""
    found = {name(p) for p in TESTS if calls(tree_of(p), functions)}
    assert found == set(allowed)


STARTS = {"Popen", "create_subprocess_exec", "create_subprocess_shell"}


def left_open(tree: ast.AST) -> Iterator[str]:
    """Connections to databases that no `closing` closes: as a context they commit, and stay."""
    for node in ast.walk(tree):
        for item in node.items if isinstance(node, ast.With) else ():
            if ast.unparse(item.context_expr).startswith("sqlite3.connect("):
                yield f"line {node.lineno}"


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_what_a_test_opens_is_closed_where_it_ends(path: Path) -> None:
    """A process is started by `tests.support`, which kills it and closes its pipes."""
    tree = tree_of(path)
    assert list(left_open(tree)) == []
    assert "support" in path.parts or not calls(tree, STARTS)


def uncounted_laws(tree: ast.AST) -> Iterator[str]:
    """Functions by `@given` with branches, of which nobody notices that one is never taken."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            by = {ast.unparse(one).partition("(")[0] for one in node.decorator_list}
            inside = list(ast.walk(node))
            branches = any(isinstance(one, ast.If | ast.Match | ast.Try) for one in inside)
            if "given" in by and "reaches" not in by and (branches or calls(node, {"assume"})):
                yield f"line {node.lineno}: {node.name}"


@pytest.mark.parametrize("path", TESTS, ids=name)
def test_a_law_with_branches_fails_where_one_is_never_reached(path: Path) -> None:
    """By `tests.support.reached`."""
    assert list(uncounted_laws(tree_of(path))) == []


@pytest.mark.parametrize("kind", ["unit", "zenoh"])
def test_tests_lie_in_the_rooms_that_they_test(kind: str) -> None:
    """Below `fleet`, or below the top for the other packages."""
    rooms = {path.parent.relative_to(ROOT / "tests" / kind) for path in TESTS if kind in path.parts}
    tops = [ROOT / "fleet", ROOT / "keyexpr_schema", ROOT]
    nowhere = {room for room in rooms if not any((top / room).is_dir() for top in tops)}
    assert nowhere | (rooms & {Path()}) == set()


def test_private_uses_are_seen() -> None:
    text = "from a._b import c\nimport a._d\nx._e\nself._f\nx.__len__\nm.setattr('a._g', 1)"
    found = [line.rpartition(" ")[2] for line in private_uses(ast.parse(text))]
    assert found == ["_b", "_d", "_e", "_g"]
