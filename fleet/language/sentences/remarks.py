"""People who speak of themselves, or say how something is: it asks for nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

from fleet.errors import NotUnderstood
from fleet.language.refusals import reason_for
from fleet.language.resolve.frames import EXAMPLE
from fleet.language.tagging.tagger import Lexeme
from fleet.language.words.tokens import Phrase, Token

_LOCATING = frozenset({"in", "here", "there"})


def of_oneself(
    words: Sequence[Lexeme], tokens: Sequence[Token], remarks: Collection[Phrase]
) -> bool:
    """Whether a sentence begins with "I am", "we have" and the like."""
    begins = [token.word for token in tokens[words[0].first : words[0].first + 4]]
    length = max((len(p) for p in remarks if tuple(begins[: len(p)]) == p), default=0)
    return bool(length) and begins[length : length + 1] != ["to"]


def remark(
    words: Sequence[Lexeme], quote: Callable[[Sequence[Lexeme]], str]
) -> tuple[str, Sequence[Lexeme]]:
    """What a sentence says of somebody, as it was written, and the command behind it.

    Raises:
        NotUnderstood: it names something known, or has a word for which goals are refused.
    """
    end = next(
        (
            i
            for i, word in enumerate(words[:-1])
            if "COMMA" in word.tags and _command(words[i + 1 :])
        ),
        len(words),
    )
    said = words[:end]
    shown = quote(said)
    special = reason_for([(word.word, word.text) for word in said])
    known = next((word.text for word in said if "NOUN" in word.tags), None)
    if special or known:
        matters = f"{known!r} is spoken of in {shown!r}, which" if known else f"{shown!r}"
        raise NotUnderstood(
            f"{matters} is no goal, and may matter: leave it out, or tell it as a fact"
        )
    return shown, words[end:]


def _command(words: Sequence[Lexeme]) -> bool:
    rest = [word for word in words if "POLITE" not in word.tags]
    return bool(rest) and "VERB" in rest[0].tags


def only_remarked(said: str) -> NotUnderstood:
    """A text says nothing but how something is: "it is cold in here"."""
    last = [word for word in said.split() if word not in _LOCATING][-1:]
    return NotUnderstood(
        f"{''.join(last)!r} in {said!r} says how something is, and asks for nothing: {EXAMPLE}"
    )
