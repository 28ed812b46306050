"""Words of a user's own: more of what `fleet/language/data` has, from a file of hers."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
from rapidfuzz import process

from fleet.errors import BadLanguageFile
from keyexpr_schema.yaml_reader import YamlFile, line_in, read_yaml

_SHIPPED = Path(__file__).parent.parent / "data"
_GROUPS = frozenset({"verbs", "prepositions"})
"""What is sorted by what it does; other verbs' synonyms are sorted by the verb."""
SYNONYMS = "same_verbs"
_ROOMS = "rooms"
_SHOWN = 5


class OwnWords(msgspec.Struct, frozen=True, kw_only=True):
    """What one file adds.

    `lists` are phrases by tag ("POLITE") or kind of verb ("fetching"), `groups` the verbs and the
    prepositions by what they do, and synonyms by the verb of a skill. `rooms` are names in common
    use for the same room.
    """

    lists: dict[str, tuple[str, ...]] = {}
    groups: dict[str, dict[str, tuple[str, ...]]] = {}
    rooms: tuple[tuple[str, ...], ...] = ()


def own_words(data: Any, file: str | YamlFile) -> OwnWords:
    """What a file of words says.

    Raises:
        BadLanguageFile: one sentence that names the file, where in it, and what would be right.
    """
    shipped, verbs = shipped_words(), shipped_verbs()
    groups = {*_GROUPS, SYNONYMS}
    lists = {*shipped, *verbs} - groups - {_ROOMS}
    if not isinstance(data, dict):
        raise BadLanguageFile(f"{file}: there must be a mapping of names to lists of phrases")

    def at(*names: str) -> str:
        return f"{file}{line_in(file, '.'.join(names))}: {': '.join(names)}"

    _known(data, {*lists, *groups, _ROOMS}, str(file))
    found: dict[str, dict[str, tuple[str, ...]]] = {}
    for name in sorted(groups & data.keys()):
        rows = data[name]
        if not isinstance(rows, dict):
            raise BadLanguageFile(f"{at(name)}: there must be a mapping to lists of phrases")
        if name in _GROUPS:
            _known(rows, verbs[name], at(name))
        found[name] = {key: _phrases(row, at(name, key)) for key, row in rows.items()}
    rooms = data.get(_ROOMS, [])
    if not isinstance(rooms, list):
        raise BadLanguageFile(f"{at(_ROOMS)}: there must be a list of lists of names")
    return OwnWords(
        lists={name: _phrases(data[name], at(name)) for name in sorted(lists & data.keys())},
        groups=found,
        rooms=tuple(_phrases(row, at(f"{_ROOMS}[{i}]")) for i, row in enumerate(rooms)),
    )


def _known(given: Mapping[Any, Any], known: Collection[str], where: str) -> None:
    for name in given:
        if name not in known:
            near = [row[0] for row in process.extract(str(name), sorted(known), limit=_SHOWN)]
            raise BadLanguageFile(f"{where}: there is no {name!r}; known are {', '.join(near)}, …")


def _phrases(row: Any, where: str) -> tuple[str, ...]:
    if not isinstance(row, list):
        raise BadLanguageFile(f"{where} must be a list of phrases")
    for i, phrase in enumerate(row):
        if not isinstance(phrase, str) or not phrase.strip():
            raise BadLanguageFile(
                f"{where}[{i}]: {phrase!r} is no phrase; put it in quotes, as YAML takes some "
                "words for something else"
            )
    return tuple(row)


def shipped_words() -> dict[str, Any]:
    """The words that are shipped, by tag."""
    return dict(_shipped("words.yaml"))


def shipped_verbs() -> dict[str, Any]:
    """The verbs, prepositions, … that are shipped."""
    return dict(_shipped("verbs.yaml"))


@cache
def _shipped(name: str) -> dict[str, Any]:
    found: dict[str, Any] = read_yaml(_SHIPPED / name, BadLanguageFile)
    return found
