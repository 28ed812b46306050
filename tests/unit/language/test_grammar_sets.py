"""What can come next in a sentence is what lark's own sets of the grammar say."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from lark import Lark
from lark.grammar import NonTerminal, Rule, Terminal
from lark.parsers.grammar_analysis import calculate_sets

import fleet.language.grammar.rules as grammar_rules
from fleet.language.grammar.rules import START, Grammar


def test_every_place_in_a_rule_has_the_tags_that_can_come_next() -> None:
    text = Path(grammar_rules.__file__).with_name("commands.lark").read_text(encoding="utf-8")
    rules = Lark(text, parser=None, lexer="basic").rules
    root = Rule(NonTerminal("$root"), [NonTerminal(START), Terminal("$END")])
    first, follow, nullable = calculate_sets([*rules, root])
    grammar = Grammar(rules)

    def bits(symbols) -> int:
        names = {s.name for s in symbols}
        return grammar.mask(frozenset(names)) | (grammar.end if "$END" in names else 0)

    expected = defaultdict(list)
    for rule in rules:
        begins = [bits(follow[rule.origin])]
        for symbol in reversed(rule.expansion):
            begins.append(bits(first[symbol]) | (begins[-1] if symbol in nullable else 0))
        expected[rule.origin.name].append(begins[::-1])

    tags = frozenset(s.name for rule in rules for s in rule.expansion if s.is_term)
    found = defaultdict(list)
    for origin, dots in grammar.usable(grammar.mask(tags)).items():
        for dot in dots:
            begins = [dot.begins]
            while dot.after is not None:
                dot = dot.after
                begins.append(dot.begins)
            found[origin].append(begins)
    assert sum(map(len, found.values())) == len(rules)
    assert {origin: sorted(rows) for origin, rows in found.items()} == {
        origin: sorted(rows) for origin, rows in expected.items()
    }
