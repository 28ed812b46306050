"""What a package exports is what may be built on: it is there, documented, and found in one place.

A package without `__all__` has no public names.
"""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from keyexpr_schema.key import Key
from tests.support.sources import tree_of

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "keyexpr_schema",
    "fleet",
    "fleet.planners",
    "fleet.allocators",
    "fleet.jobshop",
    "fleet.language",
    "fleet.llm",
    "fleet.stores",
    "fleet.timeline",
    "workers",
    "sim",
    "cli",
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^(?: {4}.*\n|\n)+", re.MULTILINE)


def exported(package: str) -> tuple[str, ...]:
    return tuple(getattr(importlib.import_module(package), "__all__", ()))


PUBLIC = [(package, name) for package in PACKAGES for name in exported(package)]


@pytest.mark.parametrize(("package", "name"), PUBLIC)
def test_a_public_name_is_there_and_documented(package: str, name: str) -> None:
    value = getattr(importlib.import_module(package), name)
    assert documentation(package, name, value), f"{package}.{name} says nothing of itself"


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_show_before_they_are_asked_for(package: str) -> None:
    asked = f"import {package} as p; print(set(getattr(p, '__all__', ())) <= set(dir(p)))"
    shown = subprocess.run(
        [sys.executable, "-c", asked], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert shown.stdout == "True\n"


def documentation(package: str, name: str, value: Any) -> str:
    """The docstring of a class or function; of a constant the text beneath it, or in the table."""
    if isinstance(value, Key):
        return value.about
    if isinstance(value, type) or (callable(value) and hasattr(value, "__code__")):
        own = vars(value).get("__doc__") if isinstance(value, type) else value.__doc__
        return "" if own is None or own.startswith(f"{name}(") else own  # a dataclass makes one
    return documented_constants(package).get(name, "")


@cache
def documented_constants(package: str) -> dict[str, str]:
    """The string literal beneath each assignment at the top of the package's modules."""
    found = {}
    for path in (ROOT / package.replace(".", "/")).rglob("*.py"):
        body = tree_of(path).body
        for node, after in pairwise(body):
            target = node.targets[0] if isinstance(node, ast.Assign) else None
            target = node.target if isinstance(node, ast.AnnAssign) else target
            literal = after.value if isinstance(after, ast.Expr) else None
            if isinstance(target, ast.Name) and isinstance(literal, ast.Constant):
                found[target.id] = str(literal.value)
    return found


def test_a_public_name_is_exported_by_one_package() -> None:
    packages = defaultdict(list)
    for package, name in PUBLIC:
        packages[name].append(package)
    assert {name: found for name, found in packages.items() if len(found) > 1} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_imported_without_what_is_heavy(package: str) -> None:
    code = f"import sys, {package}; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    ).stdout.split()
    assert not set(loaded) & {"zenoh", "mujoco", "rerun", "pulp", "scipy", "networkx", "litellm"}


def sources() -> Iterator[tuple[str, str]]:
    """Name and text of every example, and of every piece of Python in the documentation."""
    for path in sorted((ROOT / "examples").rglob("*.py")):
        yield str(path.relative_to(ROOT)), path.read_text(encoding="utf-8")
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for pattern in (BLOCK, INDENTED):
            for number, found in enumerate(pattern.finditer(text)):
                block = found[1] if found.groups() else re.sub(r"^ {4}", "", found[0], flags=re.M)
                if re.search(r"^\s*(?:from|import) \w", block, re.MULTILINE):
                    yield f"{page.relative_to(ROOT)}:{pattern.groups}-{number}", block


SOURCES = dict(sources())


@pytest.mark.parametrize("source", SOURCES)
def test_examples_and_documentation_import_public_names_only(source: str) -> None:
    assert list(internal(ast.parse(SOURCES[source]))) == []


def internal(tree: ast.AST) -> Iterator[str]:
    """Imports of what no package exports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            package = home(node.module)
            for alias in node.names if package else ():
                if node.module != package or alias.name not in exported(package):
                    yield f"from {node.module} import {alias.name}"
        elif isinstance(node, ast.Import):
            for alias in node.names:
                package = home(alias.name)
                if package and alias.name != package:
                    yield f"import {alias.name}"


def home(module: str) -> str | None:
    """The public package that a module lies in."""
    inside = [p for p in PACKAGES if module == p or module.startswith(f"{p}.")]
    return max(inside, key=len, default=None)


def test_examples_and_snippets_were_found() -> None:
    assert {"examples/own_goal.py", "examples/custom_skill.py"} <= set(SOURCES)
    assert any(source.startswith("docs/") for source in SOURCES)
