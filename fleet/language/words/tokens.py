"""From text to words: case, punctuation, contractions, numbers and ordinals made alike."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from fleet.language.words.folding import composed, folded

Phrase = tuple[str, ...]
"""Words that stand together, in the form of `Token.word`."""


def words_in(text: str) -> tuple[str, ...]:
    """The words of a list that is written as a text."""
    return tuple(text.split())


NUMBERS = {
    word: str(number)
    for number, word in enumerate(
        words_in(
            "one two three four five six seven eight nine ten eleven twelve thirteen fourteen "
            "fifteen sixteen seventeen eighteen nineteen twenty"
        ),
        start=1,
    )
}
ORDINALS = {
    word: number
    for number, word in enumerate(
        words_in(
            "first second third fourth fifth sixth seventh eighth ninth tenth eleventh twelfth"
        ),
        start=1,
    )
}
_PART = re.compile(
    r"\d+(?:st|nd|rd|th)(?![^\W_])|\d+|[^\W\d_]+(?:'[^\W\d_]+)?|'s\b|[^\w\s]", re.IGNORECASE
)
_BETWEEN_WORDS = re.compile(r"(?<=[^\W_])[-\u2010\u2011](?=[^\W_])")
_QUOTES = frozenset("\"'`“”«»")
_COMMAS = frozenset(":-\u2013\u2014")
_APOSTROPHES_FORGOTTEN = {
    word.replace("'", ""): word
    for word in words_in(
        "what's where's who's that's there's how's don't doesn't didn't isn't aren't wasn't can't "
        "won't couldn't wouldn't shouldn't haven't hasn't i'm i've you're you've they're we've"
    )
}
_ENDINGS = {"d": "would", "ll": "will", "m": "am", "re": "are", "ve": "have"}


class Token(NamedTuple):
    """One word or punctuation mark; `start` and `end` say where it stands in the text.

    `word` is in lower case, with "two" as `2` and "second" as `2nd`; `spoken` keeps those apart.
    """

    word: str
    spoken: str
    start: int
    end: int


def tokens_of(text: str) -> tuple[Token, ...]:
    """The words of a text.

    Underscores and hyphens inside words separate words, quotes are left out, colons and dashes
    count as commas, and contractions are written out: "don't" is "do not", "where's" "where 's".
    """
    text, starts = composed(text.replace("\u2019", "'").replace("…", ","))
    same_length = _BETWEEN_WORDS.sub(" ", text.replace("...", ",  "))
    found: list[Token] = []
    for match in _PART.finditer(same_length):
        start, end = match.span()
        if starts is not None:
            start, end = starts[start], starts[end]
        for spoken in _written_out(folded(match[0])):
            if spoken not in _QUOTES:
                found.append(Token(_alike(spoken), spoken, start, end))
    return tuple(found)


def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, without an article before it and punctuation around it."""
    words = [token.word for token in tokens_of(name)]
    while words and not words[-1][0].isalnum():
        words.pop()
    while words and (words[0] in ("the", "a", "an") or not words[0][0].isalnum()):
        if len(words) == 1 and words[0][0].isalnum():
            break
        words.pop(0)
    return tuple(words)


def ordinal_of(word: str) -> int | None:
    """1 for `1st` and so on; `None` for other words."""
    match = re.fullmatch(r"(\d{1,6})(?:st|nd|rd|th)", word)
    return int(match[1]) if match else None


def number_of(word: str) -> int | None:
    """The number that a word of digits stands for; `None` for other words."""
    return int(word) if word.isdecimal() and len(word) <= 6 else None


def _written_out(word: str) -> list[str]:
    word = _APOSTROPHES_FORGOTTEN.get(word, word)
    if "'" not in word or len(word) == 1:
        return ["can", "not"] if word == "cannot" else [word]
    stem, _, ending = word.partition("'")
    if ending == "t" and stem.endswith("n"):
        verb = {"can": "can", "won": "will", "shan": "shall"}.get(stem, stem[:-1])
        return [verb, "not"]
    if ending == "s":
        return [stem, "'s"] if stem else ["'s"]
    return [stem, _ENDINGS.get(ending, ending)]


def _alike(word: str) -> str:
    if word in _COMMAS:
        return ","
    if word in ORDINALS:
        number = ORDINALS[word]
        return f"{number}{ {1: 'st', 2: 'nd', 3: 'rd'}.get(number, 'th') }"
    return NUMBERS.get(word, word)


def tokens_like(words: Iterable[str]) -> list[Token]:
    """Tokens of words that stand in no text."""
    return [Token(word, word, 0, 0) for word in words]
