"""Words that narrow what a sentence asks for: who leaves one of them out says something else."""

from __future__ import annotations

from fleet.language.words.times import time_at
from fleet.language.words.tokens import tokens_of
from fleet.language.words.wordbook import Wordbook

_NARROWING = frozenset(
    [
        "NOT",
        "DONT",
        "NEVER",
        "NOBODY",
        "NOTHING",
        "NONE",
        "AVOID",
        "WITHOUT",
        "EXCEPT",
        "ONLY",
        "KEEP",
        "ALWAYS",
        "HOWOFTEN",
        "IF",
        "IFSO",
        "OTHERWISE",
        "UNLESS",
        "ASLONGAS",
        "UNTIL",
        "WHEN",
        "WHENEVER",
        "BEFORE",
        "AFTER",
        "CANCEL",
    ]
)
"""Tags of words that deny, leave out, keep, or say under which condition or in which order."""


def restricts(text: str, words: Wordbook) -> bool:
    """Whether a text denies something, leaves something out, or says when or under which condition
    it is meant, as far as its words are known; it need not be a sentence that can be read."""
    tokens = tokens_of(text)
    said = tuple(token.word for token in tokens)
    longest = max(map(len, words.phrases), default=0)
    return any(
        time_at(tokens, at) is not None
        or any(
            not _NARROWING.isdisjoint(words.phrases.get(said[at : at + length], ()))
            for length in range(1, longest + 1)
        )
        for at in range(len(said))
    )
