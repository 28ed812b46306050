"""How an answer is classed, beside what the sentence means."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable
from enum import Enum

from benchmarks.language.entries import Entry
from benchmarks.language.meanings import Meaning
from benchmarks.language.reader import Answer, AskedBack, Read, Refused

_HINT = re.compile(r"did you mean '([^']+)'")
_QUOTED = re.compile(r"'((?:[^']|'(?=\w))+)'(?!\w)|\"([^\"]+)\"")
_ASIDE = re.compile(r"; (?:known|those) are|\(did you mean")
LONGEST_QUOTE = 3
"""A refusal that quotes more words than these has not said which it is about."""


class Verdict(str, Enum):
    """What an answer is worth."""

    RIGHT = "right"
    """It was taken for what it means."""
    ASKED = "asked back"
    """It can mean several things, and was asked about; or the right meaning was offered."""
    WELL_REFUSED = "well refused"
    """It means nothing here, or nothing that the fleet can express, and the refusal names why."""
    REFUSED = "refused"
    """It means something, and was refused without a wrong hint."""
    MISLEADING = "misleading"
    """The refusal does not name what is wrong, or its hint leads elsewhere; or a question back
    does not offer what was meant."""
    WRONG = "wrong"
    """It was taken for something else, without a word."""


def judge(entry: Entry, answer: Answer, again: Callable[[str], Answer]) -> Verdict:
    """The class of an answer; `again` reads another text in the same world."""
    meanings = entry.meanings()
    match answer:
        case Read(meaning):
            return Verdict.RIGHT if meaning in meanings else Verdict.WRONG
        case AskedBack():
            return _of_question(entry, meanings, answer)
        case Refused(sentence):
            return _of_refusal(entry, meanings, sentence, again)


def as_it_should_be(entry: Entry, verdict: Verdict) -> bool:
    """Whether nothing better can be expected of the answer."""
    if entry.refused:
        return verdict is Verdict.WELL_REFUSED
    if entry.asks or (entry.typo and verdict is Verdict.ASKED):
        return verdict is Verdict.ASKED
    return verdict is Verdict.RIGHT or (bool(entry.beyond) and verdict is Verdict.WELL_REFUSED)


def _of_question(entry: Entry, meanings: tuple[Meaning, ...], answer: AskedBack) -> Verdict:
    expected = entry.candidates()
    if entry.refused:
        return Verdict.MISLEADING
    if answer.candidates:
        wanted = expected or meanings
        found = [meaning in answer.candidates for meaning in wanted]
        offered = all(found) if expected else any(found)
    elif expected:
        offered = _telling_apart(expected) <= answer.names
    else:
        offered = any(meaning.names() & answer.names for meaning in meanings)
    return Verdict.ASKED if offered else Verdict.MISLEADING


def _telling_apart(candidates: tuple[Meaning, ...]) -> frozenset[str]:
    """Names that some of the candidates speak of, and others don't."""
    spoken_of = [candidate.names() for candidate in candidates]
    return frozenset().union(*spoken_of) - frozenset.intersection(*spoken_of)


def _of_refusal(
    entry: Entry, meanings: tuple[Meaning, ...], sentence: str, again: Callable[[str], Answer]
) -> Verdict:
    hint = _HINT.search(sentence)
    if hint is not None:
        match _followed(entry.say, hint[1], again):
            case Read(meaning) if meaning in meanings:
                return Verdict.ASKED
            case Refused() if entry.refused and names(sentence, entry):
                return Verdict.WELL_REFUSED
            case _:
                return Verdict.MISLEADING
    if entry.refused:
        return Verdict.WELL_REFUSED if names(sentence, entry) else Verdict.MISLEADING
    return Verdict.WELL_REFUSED if entry.beyond else Verdict.REFUSED


def _followed(text: str, hint: str, again: Callable[[str], Answer]) -> Answer:
    """What is made of the text with the hint in place of the word that is most like it."""
    words = text.split()
    near = max(
        range(len(words)),
        key=lambda at: difflib.SequenceMatcher(None, words[at].casefold(), hint).ratio(),
    )
    return again(" ".join([*words[:near], hint, *words[near + 1 :]]))


def names(sentence: str, entry: Entry) -> bool:
    """Whether a refusal names the words that it must, and one of them first.

    A quotation of more than a few words names none of them, nor do lists of what is known.
    """
    told = _ASIDE.split(sentence.casefold())[0]
    wanted = [row.casefold().split("|") for row in entry.refused]
    if not all(any(word in told for word in row) for row in wanted):
        return False
    quoted = _QUOTED.search(told)
    first = (quoted[1] or quoted[2]) if quoted is not None else ""
    if any(word in first for row in wanted for word in row):
        return len(first.split()) <= LONGEST_QUOTE
    return any(word in _QUOTED.sub("", told) for row in wanted for word in row)
