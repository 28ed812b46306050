"""Sentences in which people speak of themselves, which ask for nothing: "I have a headache"."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import reason_for
from fleet.language.tagging.tagger import Lexeme
from fleet.language.words.tokens import Phrase, Token


def is_said_of_oneself(
    words: Sequence[Lexeme], tokens: Sequence[Token], openers: Collection[Phrase]
) -> bool:
    """Whether a sentence begins as such ones do; "I have to …" is no remark."""
    begins = [token.word for token in tokens[words[0].first : words[0].first + 4]]
    length = max((len(p) for p in openers if tuple(begins[: len(p)]) == p), default=0)
    return bool(length) and begins[length : length + 1] != ["to"]


def end_of_remark(words: Sequence[Lexeme]) -> int:
    """Where a remark ends: at a command, or with its sentence."""
    ends = (i for i, w in enumerate(words[:-1]) if "COMMA" in w.tags and _command(words[i + 1 :]))
    return next(ends, len(words))


def check_remark(words: Sequence[Lexeme], shown: str) -> None:
    """Whether a remark can be left out.

    Raises:
        NotUnderstood: it names something known, or has a word for which goals are refused.
    """
    special = reason_for([(word.word, word.text) for word in words])
    known = next((word.text for word in words if "NOUN" in word.tags), None)
    if special or known:
        matters = f"{known!r} is spoken of in {shown!r}, which" if known else f"{shown!r}"
        raise NotUnderstood(
            f"{matters} is no goal, and may matter: leave it out, or tell it as a fact"
        )


def _command(words: Sequence[Lexeme]) -> bool:
    rest = [word for word in words if "POLITE" not in word.tags]
    return bool(rest) and "VERB" in rest[0].tags
