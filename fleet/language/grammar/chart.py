"""All that a sentence can be by the grammar: lark's Earley parser over tagged words.

Several derivations of the same words are kept packed (a shared packed parse forest: Scott 2008);
each of its nodes is evaluated once, to the few best values that it can have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, cast

from lark import Lark, Token
from lark.exceptions import UnexpectedToken
from lark.grammar import NonTerminal, Rule, Terminal
from lark.lexer import Lexer
from lark.parsers.earley_common import Item
from lark.parsers.earley_forest import SymbolNode, TokenNode

from fleet.language.tagging.tagger import Lexeme

KEPT = 16
"""Values that are kept for one node: the cheapest."""

Build = Callable[[str, tuple[Any, ...], int, int], Sequence[tuple[int, Any]]]
"""From the name of a rule, its children and its span to values with costs; none: it cannot be."""


class _Word(Token):
    """A tagged word as lark wants it."""

    lexeme: Lexeme

    def __new__(cls, lexeme: Lexeme) -> _Word:
        made = cast(_Word, super().__new__(cls, "WORD", lexeme.word))
        made.lexeme = lexeme
        return made


class _Tagged(Lexer):
    """Hands tagged words over as they are."""

    def __init__(self, _: Any) -> None:
        pass

    def lex(self, lexer_state: Any, parser_state: Any) -> Iterator[Token]:
        yield from lexer_state.text


@cache
def _parser() -> Any:
    grammar = Path(__file__).with_name("commands.lark").read_text(encoding="utf-8")
    made = Lark(grammar, parser="earley", lexer=_Tagged, ambiguity="forest")
    parser = made.parser.parser
    parser.term_matcher = lambda term, token: term.name in token.lexeme.tags
    _with_unique_symbols(parser)
    return parser


@lru_cache(maxsize=1024)
def _parser_for(tags: frozenset[str]) -> Any:
    """The parser with those rules only of which all words can be there: a tenth of the work."""
    whole = _parser()
    rules = {rule for predicted in whole.predictions.values() for rule in predicted}
    usable: set[Any] = set()
    derivable: set[Any] = set()
    while True:
        more = {
            rule
            for rule in rules - usable
            if all(s.name in tags if s.is_term else s in derivable for s in rule.expansion)
        }
        if not more:
            break
        usable |= more
        derivable |= {rule.origin for rule in more}
    parser = copy(whole)
    parser.predictions = {
        origin: [rule for rule in predicted if rule in usable]
        for origin, predicted in whole.predictions.items()
    }
    return parser


class _Words:
    def __init__(self, words: Sequence[Lexeme]) -> None:
        self.words = words

    def lex(self, _: Any) -> Iterator[Token]:
        yield from map(_Word, self.words)


class _Name(NonTerminal):
    """A non-terminal of which there is just one object, so that comparing it costs nothing."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__


class _Tag(Terminal):
    """A terminal of which there is just one object."""

    __eq__ = object.__eq__
    __hash__ = object.__hash__


def _with_unique_symbols(parser: Any) -> None:
    """Have all rules share their symbols: half of the time went into comparing equal ones."""
    rules = {rule for predicted in parser.predictions.values() for rule in predicted}
    symbols = {s for rule in rules for s in (rule.origin, *rule.expansion)}
    unique = {s: _Tag(s.name) if s.is_term else _Name(s.name) for s in symbols}
    same = {
        rule: Rule(
            cast(_Name, unique[rule.origin]),
            [unique[s] for s in rule.expansion],
            rule.order,
            rule.alias,
            rule.options,
        )
        for rule in rules
    }
    parser.predictions = {
        unique[origin]: [same[rule] for rule in predicted]
        for origin, predicted in parser.predictions.items()
    }
    parser.TERMINALS = {unique[s] for s in parser.TERMINALS if s in unique}
    parser.NON_TERMINALS = {unique[s] for s in parser.NON_TERMINALS if s in unique}
    parser.NULLABLE = {unique[s] for s in parser.NULLABLE if s in unique}
    parser.start = next(name for name in parser.predictions if name.name == "start")


def _forest(parser: Any, words: Sequence[Lexeme]) -> Any:
    """The root of the forest of all derivations (as `lark.parsers.earley.Parser.parse` does it)."""
    columns, to_scan = [parser.Set()], parser.Set()
    for rule in parser.predictions[parser.start]:
        item = Item(rule, 0, 0)  # type: ignore[no-untyped-call]
        (to_scan if item.expect in parser.TERMINALS else columns[0]).add(item)
    to_scan = parser._parse(_Words(words), columns, to_scan, parser.start)
    for item in columns[-1]:
        ends = item.is_complete and item.node is not None and item.start == 0
        if ends and item.s is parser.start:
            return item.node
    raise NotGrammatical(len(words))


class NotGrammatical(Exception):
    """No derivation: `at` is the word where none goes on (the length, if more words are needed)."""

    def __init__(self, at: int) -> None:
        super().__init__(at)
        self.at = at


def parsed(words: Sequence[Lexeme], build: Build) -> list[tuple[int, Any]]:
    """What the words can be, cheapest first.

    Raises:
        NotGrammatical: they are nothing that the grammar knows.
    """
    parser = _parser_for(frozenset().union(*(w.tags for w in words)))
    try:
        root = _forest(parser, words)
    except UnexpectedToken as error:
        at = next((i for i, w in enumerate(words) if w is getattr(error.token, "lexeme", None)), 0)
        raise NotGrammatical(at) from None
    return _Evaluation(build).of(root)


class _Evaluation:
    def __init__(self, build: Build) -> None:
        self.build = build
        self.known: dict[int, list[tuple[int, Any]]] = {}

    def of(self, node: Any) -> list[tuple[int, Any]]:
        """The values of a node with their costs, cheapest first."""
        if isinstance(node, TokenNode):
            return [(0, node.token.lexeme)]
        if (known := self.known.get(id(node))) is not None:
            return known
        self.known[id(node)] = []
        rows = list(self._derivations(node))
        if len(rows) < 2:
            self.known[id(node)] = rows
            return rows
        best: dict[Any, int] = {}
        for cost, value in rows:
            if cost < best.get(value, cost + 1):
                best[value] = cost
        found = sorted(((cost, value) for value, cost in best.items()), key=lambda row: row[0])
        self.known[id(node)] = found[:KEPT]
        return found[:KEPT]

    def _derivations(self, node: SymbolNode) -> Iterator[tuple[int, Any]]:
        for packed in node.children:
            lefts = [(0, ())] if packed.left is None else self.of(packed.left)
            rights = [(0, None)] if packed.right is None else self.of(packed.right)
            for left_cost, left in lefts:
                for right_cost, right in rights:
                    children = left if packed.right is None else (*left, *_spliced(right))
                    cost = left_cost + right_cost
                    if node.is_intermediate:
                        yield cost, children
                    elif (rule := packed.rule).origin.name.startswith("_"):
                        yield cost, _Spliced(children)
                    else:
                        name = rule.alias or rule.origin.name
                        for more, value in self.build(name, children, node.start, node.end):
                            yield cost + more, value


class _Spliced(tuple[Any, ...]):
    """What a repetition gives: its children belong to the rule that it stands in."""

    __slots__ = ()


def _spliced(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, _Spliced) else (value,)
