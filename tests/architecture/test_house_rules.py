"""The rules of the house that a machine can check."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import networkx
import pytest

from keyexpr_schema.keyspace import KEYSPACE
from tests.support.sources import nodes_of, tree_of

ROOT = Path(__file__).parents[2]
PACKAGES = ("keyexpr_schema", "fleet", "workers", "sim", "cli")
MODULES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAX_LINES = 400
HEAVY = {"mujoco", "rerun", "pulp", "scipy", "networkx"}


def names(path: Path) -> str:
    return str(path.relative_to(ROOT))


def imports(path: Path) -> set[str]:
    found: set[str] = set()
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


def test_packages_import_one_way() -> None:
    """The contracts in pyproject.toml, checked by import-linter."""
    checked = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


def test_zenoh_is_imported_by_the_transport_only() -> None:
    users = {names(path.parent) for path in MODULES if "zenoh" in imports(path)}
    assert users == {"keyexpr_schema/transport", "keyexpr_schema/transport/store"}


def test_yaml_is_read_by_the_one_careful_reader() -> None:
    """YAML 1.1's traps and names that come twice are looked after in one place."""
    checked = [*MODULES, *(ROOT / "benchmarks").rglob("*.py")]
    users = {names(path) for path in checked if "yaml" in imports(path)}
    assert users == {"keyexpr_schema/yaml_reader.py"}


def test_payloads_are_decoded_by_decoders_that_are_made_one_at_a_time() -> None:
    """What `keyexpr_schema.decoding` says of threads holds for all that is read from JSON."""
    found = [
        names(path)
        for path in MODULES
        for node in nodes_of(path)
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) == "msgspec.json.decode"
        and any(keyword.arg == "type" for keyword in node.keywords)
    ]
    assert found == []


def test_no_files_import_each_other_in_a_circle() -> None:
    """Imports inside functions and those for type checkers only count as well."""
    files = {}
    for path in MODULES:
        parts = path.relative_to(ROOT).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph = networkx.DiGraph()
    for module, path in files.items():
        for node in nodes_of(path):
            if isinstance(node, ast.Import):
                wanted = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                inside = [f"{node.module}.{alias.name}" for alias in node.names]
                wanted = [name if name in files else node.module for name in inside]
            else:
                continue
            graph.add_edges_from((module, name) for name in wanted if name in files)
    circles = [sorted(c) for c in networkx.strongly_connected_components(graph) if len(c) > 1]
    assert circles == []


def test_no_key_is_spelled_outside_the_table() -> None:
    """Every first chunk with a slash behind it, in a string that looks like a key expression."""
    heads = sorted({re.escape(key.template.split("/")[0]) for key in KEYSPACE})
    spelled = re.compile(rf"(?:{'|'.join(heads)})/[\w{{}}*/]+")
    found = []
    for path in MODULES:
        if path.name == "keyspace.py":
            continue
        prose = {
            id(node.value)
            for node in nodes_of(path)
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        }
        found += [
            f"{names(path)}:{node.lineno}: {node.value}"
            for node in nodes_of(path)
            if isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in prose
            and spelled.fullmatch(node.value)
        ]
    assert found == []


@pytest.mark.parametrize("path", MODULES, ids=names)
def test_modules_stay_small(path: Path) -> None:
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= MAX_LINES, f"{lines} lines: split what has grown two purposes"


def test_no_module_is_named_for_having_no_purpose() -> None:
    vague = {"utils.py", "util.py", "common.py", "helpers.py", "helper.py", "manager.py", "misc.py"}
    assert [names(path) for path in MODULES if path.name in vague] == []


def test_every_module_and_public_thing_says_what_it_is_for() -> None:
    silent = []
    for path in MODULES:
        tree = tree_of(path)
        if tree.body and not ast.get_docstring(tree):
            silent.append(names(path))
        for node in tree.body:
            public = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
            if public and not node.name.startswith("_") and not ast.get_docstring(node):
                silent.append(f"{names(path)}: {node.name}")
    assert silent == []


@pytest.mark.parametrize("package", ["keyexpr_schema.keyspace", "fleet.core.step", "cli.main"])
def test_heavy_libraries_wait_until_they_are_needed(package: str) -> None:
    code = f"import sys, {package}; print(*({HEAVY!r} & set(sys.modules)))"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert loaded.stdout.strip() == ""


def test_no_registry_or_index_is_named() -> None:
    """A user's own package index serves the locks as well as anybody's."""
    index = re.compile(r"--(?:extra-)?index-url|pypi\.org|files\.pythonhosted\.org", re.I)
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode != 0:
        pytest.skip("not a git checkout, so there is no list of committed files to look through")
    own = names(Path(__file__))
    for name in filter(None, listed.stdout.split("\0")):
        path = ROOT / name
        if name == own or not path.is_file() or path.suffix in {".png", ".rrd"}:
            continue
        text = path.read_text(encoding="utf-8", errors="replace").replace("--no-emit-index-url", "")
        assert not index.search(text), f"{name} names a package index"
