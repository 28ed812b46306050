"""Source files as trees: each is read and parsed once, however many rules look at it."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path


@cache
def tree_of(path: Path) -> ast.Module:
    """The tree of a source file, which nobody changes."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of it, in the order of `ast.walk`."""
    return tuple(ast.walk(tree_of(path)))


def forget() -> None:
    """Give back the memory that the trees take."""
    nodes_of.cache_clear()
    tree_of.cache_clear()
