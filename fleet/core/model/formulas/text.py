"""Formulas as skill files write them, read by recursive descent; errors are one sentence.

formula  := part ("or" part)*            part := bit ("and" bit)*
bit      := "not" bit | "(" formula ")" | ("all" | "any") "(" x ":" type "," formula ")"
          | type "(" name ")" | term (= | != | < | <= | > | >=) term
term     := item (("+" | "-") item)*
item     := number | word | relation "(" name ")" | "count" "(" x ":" type "," formula ")"
          | "sum" "(" x ":" type "," formula "," term ")"
effect   := "all" "(" x ":" type "," effect ")" | "if" formula ":" effect
          | relation "(" name ")" ("=" value | "+=" term | "-=" term)
"""

from __future__ import annotations

import re
from collections.abc import Collection

from fleet.core.model.formulas.evaluation import COMPARISONS
from fleet.core.model.formulas.nodes import (
    TRUE,
    And,
    Compare,
    ConditionalEffect,
    Constant,
    Exists,
    ForAll,
    Formula,
    Holds,
    Is,
    Not,
    Or,
    Sum,
    Term,
    Total,
    Variable,
)
from fleet.core.model.parameter_types import BadType, parse_type
from keyexpr_schema.facts import FactKey, Literal, Value, parse_value

_TOKEN = re.compile(
    r"\s*(?:(?P<text>\"(?:[^\"\\]|\\.)*\")|(?P<number>\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?![\w.]))"
    r"|(?P<word>\w+(?:[.-]\w+)*)|(?P<mark>\+=|-=|<=|>=|!=|[=<>()+\-:,&|]))"
)
KEYWORDS = frozenset({"not", "and", "or", "all", "any", "count", "sum", "if"})


class BadFormula(ValueError):
    """A text that is no formula; the message says where, and what would be right."""


def parse_formula(text: str, names: Collection[str]) -> Formula:
    """The formula that `text` says; `names` are the parameters that it may speak of.

    Raises:
        BadFormula: it is none.
    """
    reader = _Reader(text, names)
    found = reader.formula()
    reader.end()
    return found


def parse_effect(text: str, names: Collection[str]) -> ConditionalEffect:
    """The effect that `text` says; one that holds for nothing in `each` and always is plain.

    Raises:
        BadFormula: it is none.
    """
    reader = _Reader(text, names)
    found = reader.effect()
    reader.end()
    return found


class _Reader:
    def __init__(self, text: str, names: Collection[str]) -> None:
        self._text = text
        self._names = {name: name for name in names}
        self._tokens: list[tuple[str, str]] = []
        at = 0
        while at < len(text.rstrip()):
            found = _TOKEN.match(text, at)
            if found is None or found.lastgroup is None:
                raise BadFormula(f"{text!r}: {text[at:].strip()!r} cannot be read")
            self._tokens.append((found.lastgroup, found[found.lastgroup]))
            at = found.end()
        self._at = 0

    def _peek(self, ahead: int = 0) -> str:
        at = self._at + ahead
        return self._tokens[at][1] if at < len(self._tokens) else ""

    def _wrong(self, wanted: str) -> BadFormula:
        here = f"at {self._peek()!r}" if self._peek() else "at the end"
        return BadFormula(f"{self._text!r}: {here} there should be {wanted}")

    def _take(self, *marks: str) -> str:
        if self._peek() not in marks:
            raise self._wrong(" or ".join(repr(mark) for mark in marks))
        self._at += 1
        return self._tokens[self._at - 1][1]

    def _word(self, what: str) -> str:
        if self._at >= len(self._tokens) or self._tokens[self._at][0] != "word":
            raise self._wrong(what)
        self._at += 1
        return self._tokens[self._at - 1][1]

    def _starts(self, *words: str) -> bool:
        return self._peek() in words and self._peek(1) == "("

    def end(self) -> None:
        """Nothing may be left."""
        if self._at < len(self._tokens):
            raise self._wrong("nothing more, or `and`, `or`")

    def formula(self) -> Formula:
        """Alternatives."""
        rows = [self._part()]
        while self._peek() == "or":
            self._take("or")
            rows.append(self._part())
        return rows[0] if len(rows) == 1 else Or(tuple(rows))

    def _part(self) -> Formula:
        rows = [self._bit()]
        while self._peek() == "and":
            self._take("and")
            rows.append(self._bit())
        return rows[0] if len(rows) == 1 else And(tuple(rows))

    def _bit(self) -> Formula:
        if self._peek() == "not":
            self._take("not")
            return Not(self._bit())
        if self._peek() == "(":
            self._take("(")
            inner = self.formula()
            self._take(")")
            return inner
        if self._starts("all", "any"):
            word = self._take("all", "any")
            name, kind = self._opened()
            of = self.formula()
            self._closed(name)
            return (ForAll if word == "all" else Exists)(_mark(name), kind, of)
        if self._peek(1) == "(" and self._peek(3) == ")" and not self._starts("count", "sum"):
            after = self._peek(4)
            if after not in (*COMPARISONS, "+", "-"):
                return self._test()
        left = self._term()
        relation = self._take(*COMPARISONS)
        right = self._term()
        if relation in ("=", "!=") and isinstance(left, Variable) and isinstance(right, Constant):
            literal = Holds(Literal(left.key, right.value))
            return literal if relation == "=" else Not(literal)
        return Compare(left, relation, right)

    def _test(self) -> Formula:
        kind = self._word("a feature or kind of things")
        self._take("(")
        name = self._subject()
        self._take(")")
        return Is(name, _type(kind, self._text))

    def _opened(self) -> tuple[str, str]:
        """The variable of a quantifier and its type; the variable may be spoken of from now on."""
        self._take("(")
        name = self._word("a name for what is spoken of")
        if name in self._names or name in KEYWORDS:
            raise BadFormula(f"{self._text!r}: {name!r} has a meaning already; use another name")
        self._take(":")
        words = [self._word("a type")]
        while self._peek() in ("&", "|"):
            words += [self._take("&", "|"), self._word("a type")]
        kind = _type(" ".join(words), self._text)
        self._take(",")
        self._names[name] = _mark(name)
        return name, kind

    def _closed(self, name: str) -> None:
        self._take(")")
        del self._names[name]

    def _subject(self) -> str:
        name = self._word("a parameter")
        if name not in self._names:
            raise BadFormula(
                f"{self._text!r} speaks of {name!r}, which is not a parameter; "
                f"those are {', '.join(self._names)}"
            )
        return self._names[name]

    def _term(self) -> Term:
        plus, minus = [self._item()], list[Term]()
        while self._peek() in ("+", "-"):
            (plus if self._take("+", "-") == "+" else minus).append(self._item())
        return plus[0] if len(plus) == 1 and not minus else Sum(tuple(plus), tuple(minus))

    def _item(self) -> Term:
        if self._starts("count", "sum"):
            word = self._take("count", "sum")
            name, kind = self._opened()
            where = self.formula()
            of: Term = Constant(1)
            if word == "sum":
                self._take(",")
                of = self._term()
            self._closed(name)
            return Total(_mark(name), kind, where, of)
        if self._peek(1) == "(":
            return Variable(self._variable())
        return Constant(self._value())

    def _variable(self) -> FactKey:
        relation = self._word("a relation such as `at(object)`")
        self._take("(")
        subject = self._subject()
        self._take(")")
        return FactKey(relation, subject)

    def _value(self) -> Value:
        if self._peek() == "-":
            self._take("-")
            value = self._value()
            if isinstance(value, int | float):
                return -value
            raise self._wrong("a number after `-`")
        if self._at >= len(self._tokens) or self._tokens[self._at][0] == "mark":
            raise self._wrong("a value, a parameter or a relation such as `at(object)`")
        if self._peek() in KEYWORDS:
            raise self._wrong("a value")
        _, text = self._tokens[self._at]
        self._at += 1
        return self._names[text] if text in self._names else parse_value(text)

    def effect(self) -> ConditionalEffect:
        """What becomes true, for whom and when."""
        if self._starts("all"):
            self._take("all")
            name, kind = self._opened()
            inner = self.effect()
            self._closed(name)
            each = ((_mark(name), kind), *inner.each)
            return ConditionalEffect(inner.variable, inner.value, inner.add, inner.when, each)
        if self._peek() == "if":
            self._take("if")
            when = self.formula()
            self._take(":")
            inner = self.effect()
            if inner.each:
                raise BadFormula(f"{self._text!r}: write `all(x: type, if …: …)`, `all` first")
            both = when if inner.when == TRUE else And((when, inner.when))
            return ConditionalEffect(inner.variable, inner.value, inner.add, both)
        if self._peek(1) != "(":
            raise self._wrong("an effect such as `at(object) = place`")
        variable = self._variable()
        how = self._take("=", "+=", "-=")
        if how == "=":
            return ConditionalEffect(variable, self._value())
        amount = self._term()
        return ConditionalEffect(variable, add=amount if how == "+=" else Sum((), (amount,)))


def _mark(name: str) -> str:
    return f"${name}"


def _type(text: str, where: str) -> str:
    try:
        return str(parse_type(text))
    except BadType as wrong:
        raise BadFormula(f"{where!r}: {wrong}") from None


def formula_text(node: Formula) -> str:
    """The formula as a skill file has it."""
    match node:
        case Holds(literal):
            return _plain(str(literal))
        case Not(Holds(literal)):
            return _plain(str(literal)).replace(" = ", " != ", 1)
        case _:
            return _plain(_written(node))


def effect_text(effect: ConditionalEffect) -> str:
    """The effect as a skill file has it."""
    text = (
        str(Literal(effect.variable, effect.value))
        if effect.add is None
        else f"{effect.variable} += {_written(effect.add)}"
    )
    if effect.when != TRUE:
        text = f"if {_written(effect.when)}: {text}"
    for name, kind in reversed(effect.each):
        text = f"all({name}: {kind}, {text})"
    return _plain(text)


def _plain(text: str) -> str:
    return text.replace("$", "")


def _written(node: Formula | Term) -> str:
    match node:
        case Constant(value):
            return str(Literal(FactKey("", ""), value)).partition(" = ")[2]
        case Variable(key):
            return str(key)
        case Sum(plus, minus):
            text = " + ".join(map(_written, plus)) or "0"
            return "".join([text, *(f" - {_written(term)}" for term in minus)])
        case Total(name, kind, where, of):
            if not kind:
                return f"({_written(of)} if {_written(where)})"
            if of == Constant(1):
                return f"count({name}: {kind}, {_written(where)})"
            return f"sum({name}: {kind}, {_written(where)}, {_written(of)})"
        case Is(name, kind):
            return f"{kind}({name})"
        case Compare(left, relation, right):
            return f"{_written(left)} {relation} {_written(right)}"
        case Not(of):
            return f"not {_written(of)}"
        case And(rows):
            return f"({' and '.join(map(_written, rows))})" if rows else "nothing"
        case Or(rows):
            return f"({' or '.join(map(_written, rows))})" if rows else "never"
        case ForAll(name, kind, of):
            return f"all({name}: {kind}, {_written(of)})"
        case Exists(name, kind, of):
            return f"any({name}: {kind}, {_written(of)})"
        case _:
            return str(node.literal)
