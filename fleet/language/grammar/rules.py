"""The grammar as a chart parser wants it: dotted rules, and what can come next as bits.

lark reads the file and writes repetitions and choices out as plain rules.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from lark import Lark
from lark.grammar import Rule

START = "start"
_END = "$END"
_MOST_KNOWN = 1024
_NEVER_BEFORE = {"headless": ("NOUN", "UNK", "ONE", "ORD", "BASKET", "NUM")}
"""By the name of a rule: "the second" is no phrase of its own where its noun comes next."""


class Dot:
    """A rule of which some symbols have been found.

    `expects` is the next symbol: the name of what the grammar makes, or, where `terminal`, that of
    a tag; `after` the rule with that symbol found as well. Where `after` is `None`, all of it has
    been found. `begins` has as bits the tags that the next word must have one of, `never` those of
    which it must have none. `name` is what derivations by the rule are called.
    """

    __slots__ = ("after", "begins", "expects", "label", "name", "never", "origin", "terminal")

    def __init__(self, rule: Rule, at: int, begins: int, after: Dot | None, never: int = 0) -> None:
        self.after, self.begins, self.never = after, begins, never
        self.origin = str(rule.origin.name)  # of lark's own strings comparing is dear
        self.name = str(rule.alias or self.origin)
        symbol = rule.expansion[at] if after is not None else None
        self.expects = "" if symbol is None else str(symbol.name)
        self.terminal: bool = symbol is not None and symbol.is_term
        self.label: Any = self if after is not None else self.origin


class Grammar:
    """All rules, by what they make."""

    def __init__(self, rules: Sequence[Rule]) -> None:
        tags = {str(s.name) for rule in rules for s in rule.expansion if s.is_term}
        self._bits = {name: 1 << i for i, name in enumerate(sorted({*tags, _END}))}
        self.end = self._bits[_END]
        """The bit that stands for the end of the text."""
        self._known: dict[int, Mapping[str, tuple[Dot, ...]]] = {}
        self._masks: dict[frozenset[str], int] = {}
        rows = [(str(r.origin.name), tuple(str(s.name) for s in r.expansion)) for r in rules]
        sets = _sets(rows, self._bits)
        self._rules = tuple(
            (self._dotted(rule, sets), self._needs(rule), self._uses(rule)) for rule in rules
        )

    def mask(self, tags: frozenset[str]) -> int:
        """Tags as bits; those that no rule names are none."""
        if (known := self._masks.get(tags)) is None:
            known = self._masks[tags] = sum(self._bits.get(tag, 0) for tag in tags)
        return known

    def usable(self, tags: int) -> Mapping[str, tuple[Dot, ...]]:
        """Those rules, of which all words can be there, by what they make: a tenth of them."""
        if (known := self._known.get(tags)) is None:
            left = [row for row in self._rules if not row[1] & ~tags]
            found: dict[str, list[Dot]] = {}
            while True:
                rest = []
                for row in left:
                    if all(name in found for name in row[2]):
                        found.setdefault(row[0].origin, []).append(row[0])
                    else:
                        rest.append(row)
                if len(rest) == len(left):
                    break
                left = rest
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            known = self._known[tags] = {name: tuple(dots) for name, dots in found.items()}
        return known

    def _needs(self, rule: Rule) -> int:
        return sum({self._bits[symbol.name] for symbol in rule.expansion if symbol.is_term})

    @staticmethod
    def _uses(rule: Rule) -> tuple[str, ...]:
        return tuple(str(symbol.name) for symbol in rule.expansion if not symbol.is_term)

    @staticmethod
    def _dotted(rule: Rule, sets: _Sets) -> Dot:
        begins = sets.follow[rule.origin.name]
        # Tags that no rule names are none.
        never = sum(sets.first.get(tag, 0) for tag in _NEVER_BEFORE.get(str(rule.alias), ()))
        dot = Dot(rule, len(rule.expansion), begins, None, never)
        for at in range(len(rule.expansion) - 1, -1, -1):
            begins = sets.before(rule.expansion[at].name, dot.begins)
            dot = Dot(rule, at, begins, dot)
        return dot


class _Sets(NamedTuple):
    """By symbol: with which tags it can begin, and which can come after it; and which symbols can
    be nothing. (Aho, Lam, Sethi, Ullman: Compilers, 4.4.2.)"""

    first: dict[str, int]
    follow: dict[str, int]
    nullable: set[str]

    def before(self, name: str, after: int) -> int:
        """The tags with which a symbol can begin where these can come after it."""
        return self.first[name] | after if name in self.nullable else self.first[name]


def _sets(rows: Collection[tuple[str, Sequence[str]]], bits: Mapping[str, int]) -> _Sets:
    made = _Sets({**bits}, {}, set())
    for origin, _ in rows:
        made.first[origin] = made.follow[origin] = 0
    made.follow[START] = bits[_END]
    # Each time all rules are looked at, until none says more (`any` would stop at the first).
    while sum(_taken_in(made, origin, names) for origin, names in rows):
        pass
    while sum(_passed_on(made, origin, names) for origin, names in rows):
        pass
    return made


def _taken_in(sets: _Sets, origin: str, names: Iterable[str]) -> bool:
    """Whether a rule says more of how what it makes can begin."""
    begins, empty = sets.first[origin], True
    for name in names:
        begins |= sets.first[name]
        if name not in sets.nullable:
            empty = False
            break
    more = begins != sets.first[origin] or (empty and origin not in sets.nullable)
    sets.first[origin] = begins
    if empty:
        sets.nullable.add(origin)
    return more


def _passed_on(sets: _Sets, origin: str, names: Sequence[str]) -> bool:
    """Whether a rule says more of what can come after what it is made of."""
    after, more = sets.follow[origin], False
    for name in reversed(names):
        known = sets.follow.get(name)
        if known is not None and after & ~known:
            sets.follow[name], more = known | after, True
        after = sets.before(name, after)
    return more


@cache
def shipped_grammar() -> Grammar:
    """The grammar of sentences."""
    text = Path(__file__).with_name("commands.lark").read_text(encoding="utf-8")
    return Grammar(Lark(text, parser=None, lexer="basic").rules)  # only the rules are used
