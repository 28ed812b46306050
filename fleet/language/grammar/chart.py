"""All that a sentence can be by the grammar: an Earley chart over tagged words.

Several derivations of the same words are kept packed (a shared packed parse forest as in E. Scott,
"SPPF-style parsing from Earley recognisers", 2008); each of its nodes is evaluated once, to the
few best values that it can have. No item is kept that the next word cannot go on with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from itertools import chain
from operator import or_
from typing import Any

from fleet.language.grammar.rules import START, Dot, shipped_grammar
from fleet.language.tagging.tagger import Lexeme

KEPT = 16
"""Values that are kept for one node: the cheapest."""

_LISTED = frozenset({"LISTED"})
_JOINING = frozenset({"COMMA", "AND"})
_NAMING = frozenset({"DET", "INDEF", "NUM", "ORD", "ADJ", "SUP", "NOUN", "UNK"})
_DOING = frozenset({"VERB", "FIN", "GER", "PART", "PREP", "BE", "MODAL", "PARTICLE", "HOME"})

Build = Callable[[str, tuple[Any, ...], int, int], Sequence[tuple[int, Any]]]
"""From the name of a rule, its children and its span to values with costs; none: it cannot be."""


class NotGrammatical(Exception):
    """No derivation: `at` is the word where none goes on (the length, if more words are needed)."""

    def __init__(self, at: int) -> None:
        super().__init__(at)
        self.at = at


class _Node:
    """What some words can be: the ways to make it, each a rule with what is left and right in it.

    `partial`: of a rule that is not complete yet the values are the children found so far.
    """

    __slots__ = ("complete", "end", "families", "partial", "start", "values")

    def __init__(self, partial: bool, start: int, end: int) -> None:
        self.partial, self.start, self.end = partial, start, end
        self.complete = False
        self.families: dict[tuple[Any, ...], tuple[Dot, _Node | None, _Node | Lexeme | None]] = {}
        self.values: list[tuple[int, Any]] | None = None

    def add(self, dot: Dot, left: _Node | None, right: _Node | Lexeme | None) -> None:
        """One more way to make it."""
        self.families[dot, id(left), id(right)] = (dot, left, right)


_Item = tuple[Dot, int, "_Node | None"]
"""A rule with what was found of it, since where, and the node of that."""


class _Place:
    """The item set between two words; `ahead` is what the next word can be, as bits."""

    def __init__(self, at: int, ahead: int, rules: Mapping[str, tuple[Dot, ...]]) -> None:
        self.at, self.ahead, self.rules = at, ahead, rules
        self.nodes: dict[tuple[Any, int], _Node] = {}
        self.waiting: dict[str, list[_Item]] = {}
        """Who waits for something that begins here."""
        self._open: list[_Item] = []
        self._seen: set[tuple[Dot, int]] = set()

    def expect(self, name: str) -> None:
        """Begin all rules that make it and can go on with the next word."""
        self.waiting[name] = []
        for dot in self.rules.get(name, ()):
            if dot.begins & self.ahead:
                self._open.append((dot, self.at, None))

    def advance(self, item: _Item, found: _Node | Lexeme) -> None:
        """Add the item with what it waited for, if the next word can go on with that."""
        dot, start, left = item
        dot = dot.after or dot
        if not dot.begins & self.ahead or dot.never & self.ahead:
            return
        node = self.node(dot, start)
        node.add(dot, left, found)
        if (dot, start) not in self._seen:
            self._seen.add((dot, start))
            self._open.append((dot, start, node))

    def node(self, dot: Dot, start: int) -> _Node:
        """What is made from there to here."""
        key = (dot.label, start)
        if (node := self.nodes.get(key)) is None:
            node = self.nodes[key] = _Node(dot.after is not None, start, self.at)
        return node

    def close(self, before: Sequence[_Place]) -> list[_Item]:
        """Complete and begin all that can be here; what is left waits for the next word."""
        scanning: list[_Item] = []
        empty: dict[str, _Node] = {}
        while self._open:
            item = self._open.pop()
            dot, start, node = item
            if dot.after is None:
                if node is None:
                    node = self.node(dot, start)
                    node.add(dot, None, None)
                if node.complete:
                    continue
                node.complete = True
                if start == self.at:
                    empty[dot.origin] = node
                place = self if start == self.at else before[start]
                for waiting in tuple(place.waiting.get(dot.origin, ())):
                    self.advance(waiting, node)
            elif dot.terminal:
                scanning.append(item)
            else:
                if dot.expects not in self.waiting:
                    self.expect(dot.expects)
                self.waiting[dot.expects].append(item)
                if dot.expects in empty:
                    self.advance(item, empty[dot.expects])
        return scanning


def inside_lists(words: Sequence[Lexeme]) -> Iterator[int]:
    """Commas and "and" between plain names in a row, but for the first and the last of them.

    There a list goes on, and no clause begins: else a list could end after each of its items.
    """
    joints: list[list[int]] = []
    begun = False
    for at, word in enumerate(words):
        if word.tags & _JOINING and begun:
            joints.append([at])
        elif word.tags & _JOINING and joints and joints[-1][-1] == at - 1:
            joints[-1].append(at)
        elif word.tags & _NAMING and not word.tags & _DOING:
            begun = True
            continue
        else:
            yield from chain(*joints[1:-1])
            joints = []
        begun = False
    yield from chain(*joints[1:-1])


def _forest(words: Sequence[Lexeme]) -> _Node:
    """The root of the forest of all derivations.

    Raises:
        NotGrammatical: there is none.
    """
    grammar = shipped_grammar()
    masks = [grammar.mask(word.tags) for word in words]
    for at in inside_lists(words):
        masks[at] = grammar.mask(_LISTED)
    rules = grammar.usable(reduce(or_, masks, 0))
    masks.append(grammar.end)
    here = _Place(0, masks[0], rules)
    here.expect(START)
    places: list[_Place] = []
    for at, word in enumerate(words):
        scanning = here.close(places)
        if not scanning:
            raise NotGrammatical(at)
        places.append(here)
        here = _Place(at + 1, masks[at + 1], rules)
        for item in scanning:
            here.advance(item, word)
    here.close(places)
    root = here.nodes.get((START, 0))
    if root is None:
        raise NotGrammatical(len(words))
    return root


def parsed(words: Sequence[Lexeme], build: Build) -> list[tuple[int, Any]]:
    """What the words can be, cheapest first.

    Raises:
        NotGrammatical: they are nothing that the grammar knows.
    """
    return _Evaluation(build).of(_forest(words))


class _Evaluation:
    def __init__(self, build: Build) -> None:
        self.build = build

    def of(self, node: _Node | Lexeme) -> list[tuple[int, Any]]:
        """The values of a node with their costs, cheapest first."""
        if isinstance(node, Lexeme):
            return [(0, node)]
        if node.values is None:
            node.values = []
            node.values = self._best(list(self._derivations(node)))
        return node.values

    @staticmethod
    def _best(rows: list[tuple[int, Any]]) -> list[tuple[int, Any]]:
        if len(rows) < 2:
            return rows
        best: dict[Any, int] = {}
        for cost, value in rows:
            if cost < best.get(value, cost + 1):
                best[value] = cost
        return sorted(((cost, value) for value, cost in best.items()), key=lambda row: row[0])[
            :KEPT
        ]

    def _derivations(self, node: _Node) -> Iterator[tuple[int, Any]]:
        for dot, first, last in node.families.values():
            lefts = [(0, ())] if first is None else self.of(first)
            rights = [(0, None)] if last is None else self.of(last)
            for left_cost, left in lefts:
                for right_cost, right in rights:
                    children = left if last is None else (*left, *_spliced(right))
                    cost = left_cost + right_cost
                    if node.partial:
                        yield cost, children
                    elif dot.origin.startswith("_"):
                        yield cost, _Spliced(children)
                    else:
                        for more, value in self.build(dot.name, children, node.start, node.end):
                            yield cost + more, value


class _Spliced(tuple[Any, ...]):
    """What a repetition gives: its children belong to the rule that it stands in."""

    __slots__ = ()


def _spliced(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, _Spliced) else (value,)
