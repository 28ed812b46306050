"""Every file, folder and module that the documentation names is there."""

from __future__ import annotations

import re
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path

import pytest

from keyexpr_schema.keyspace import KEYSPACE

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("sim/**/*.md")])
PACKAGES = ("keyexpr_schema", "fleet", "workers", "sim", "cli", "benchmarks", "tests")
KEYS = {key.template for key in KEYSPACE}
FOLDERS = (*PACKAGES, "configs", "examples", "docs")
_CODE = re.compile(r"`([^`\n]+)`")
_LINK = re.compile(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)")
_PATH = re.compile(rf"(?:{'|'.join(FOLDERS)})(?:/[\w.*-]+)*/?")
_MODULE = re.compile(rf"(?:{'|'.join(PACKAGES)})(?:\.\w+)+")


def _missing(page: Path) -> list[str]:
    text = page.read_text()
    found = [link for link in _LINK.findall(text) if not (page.parent / link).exists()]
    for code in _CODE.findall(text):
        if _PATH.fullmatch(code) and "/" in code:
            if code not in KEYS and not list(ROOT.glob(code.rstrip("/"))):
                found.append(code)
        elif _MODULE.fullmatch(code) and not _is_there(code):
            found.append(code)
    return found


def _is_there(dotted: str) -> bool:
    """Whether it is a module, or a name that stands in one."""
    module, _, name = dotted.rpartition(".")
    for found in (_spec(dotted), _spec(module)):
        if found is None:
            continue
        if found.name == dotted:
            return True
        return found.origin is not None and name in re.findall(
            r"\w+", Path(found.origin).read_text()
        )
    return False


def _spec(dotted: str) -> ModuleSpec | None:
    try:
        return find_spec(dotted)
    except ModuleNotFoundError:  # what it should stand in is no package
        return None


def test_there_are_pages_and_names_in_them() -> None:
    text = "".join(page.read_text() for page in PAGES)
    assert len(PAGES) > 10
    assert sum(1 for code in _CODE.findall(text) if _PATH.fullmatch(code)) > 20


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_what_a_page_names_is_there(page: Path) -> None:
    assert not _missing(page)


def test_the_index_has_every_decision_by_its_title() -> None:
    folder = ROOT / "docs" / "decisions"
    index = (folder / "README.md").read_text()
    for page in folder.glob("0*.md"):
        title = page.read_text().splitlines()[0].removeprefix("# ")
        assert f"- [{page.name[:4]}]({page.name}) {title}\n" in index
