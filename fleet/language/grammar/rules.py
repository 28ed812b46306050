"""The grammar as a chart parser wants it: dotted rules, and what can come next as bits.

lark reads the file and writes repetitions and choices out as plain rules.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark
from lark.grammar import NonTerminal, Rule, Terminal
from lark.parsers.grammar_analysis import calculate_sets

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
        ended = Rule(NonTerminal("$root"), [NonTerminal(START), Terminal(_END)])
        first, follow, nullable = calculate_sets([*rules, ended])  # type: ignore[no-untyped-call]
        terminals = sorted({str(s.name) for s in first if s.is_term})
        self._bits = {name: 1 << i for i, name in enumerate(terminals)}
        self.end = self._bits[_END]
        """The bit that stands for the end of the text."""
        self._known: dict[int, Mapping[str, tuple[Dot, ...]]] = {}
        self._masks: dict[frozenset[str], int] = {}
        self._rules = tuple(
            (self._dotted(rule, first, follow, nullable), self._needs(rule), self._uses(rule))
            for rule in rules
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

    def _dotted(
        self,
        rule: Rule,
        first: Mapping[Any, Collection[Any]],
        follow: Mapping[Any, Collection[Any]],
        nullable: Collection[Any],
    ) -> Dot:
        begins = sum(self._bits[s.name] for s in follow[rule.origin])
        never = sum(self._bits[tag] for tag in _NEVER_BEFORE.get(str(rule.alias), ()))
        dot = Dot(rule, len(rule.expansion), begins, None, never)
        for at in range(len(rule.expansion) - 1, -1, -1):
            symbol = rule.expansion[at]
            own = sum(self._bits[s.name] for s in first[symbol])
            begins = own | dot.begins if symbol in nullable else own
            dot = Dot(rule, at, begins, dot)
        return dot


@cache
def shipped_grammar() -> Grammar:
    """The grammar of sentences."""
    text = Path(__file__).with_name("commands.lark").read_text(encoding="utf-8")
    return Grammar(Lark(text, parser="earley", lexer="dynamic", ambiguity="forest").rules)
