"""Why a sentence is refused, in one sentence that says what would be right."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rapidfuzz import fuzz, process
from rapidfuzz.distance import OSA

_NEAR = 75
_SHORT, _LONG = 3, 7
_SHOWN = 5
"""Names that a refusal lists."""

_WHY: dict[str, str] = {
    word: reason
    for words, reason in (
        (
            "not never no none nobody nothing without neither nor except excluding avoid stop "
            "prevent forbid refrain but",
            "says what must not be, or leaves something out; say what must hold, name by name",
        ),
        (
            "if when whenever unless while until till once before after because since whether "
            "depending otherwise else provided",
            "makes it depend on something else, which {what} cannot; give it when it is time, "
            'or put one thing after the other with "then"',
        ),
        (
            "pm oclock o'clock clock minute minutes hour hours sec secs seconds day days week "
            "weeks month today tomorrow tonight yesterday morning afternoon evening night noon "
            "midnight later soon daily weekly hourly monday tuesday wednesday thursday friday "
            "saturday sunday always constantly",
            "names a time, which {what} cannot: leave it out",
        ),
        (
            "again twice thrice times repeatedly forever continuously",
            "asks for repetition, which {what} cannot: give it again when it was reached",
        ),
        (
            "or rather instead",
            "leaves a choice that cannot be left open; say one of them",
        ),
        (
            "maybe perhaps probably possibly might may likely presumably think believe guess",
            "is uncertain; say what holds, or that nobody knows",
        ),
        (
            "near nearby beside next under underneath behind between above below left right front "
            "close around",
            "names a relation that is not known; known are in, on and at",
        ),
        (
            "me us here myself you yourself",
            "names somebody whose place is not known; name a place or a robot",
        ),
        (
            "quickly slowly carefully gently fast quietly silently cautiously safely together",
            "says how it is to be done, which {what} cannot: leave it out",
        ),
        (
            "with using use via",
            "says how or by whom it is to be done; who does what is found by the allocator, "
            "so leave it out",
        ),
        ("was were had", "tells of the past; say what holds now"),
    )
    for word in words.split()
}


def reason_for(words: Iterable[tuple[str, str]], what: str = "a goal") -> str | None:
    """What is special about words (word, as spoken) that could not be read, if anything is.

    `what` could not be read: a goal or a fact.
    """
    before = ""
    for word, shown in words:
        known = "pm" if word == "am" and before.isdecimal() else word  # not of "I am"
        if known in _WHY:
            return f"{shown!r} {_WHY[known].format(what=what)}"
        before = word
    return None


def suggestion(phrase: str, names: Iterable[str]) -> str:
    """` (did you mean 'hallway'?)` for a near miss, else nothing.

    One letter of a short word may be wrong or two neighbours swapped, two in a long one.
    """
    said = phrase.casefold()
    known = sorted(set(names) - {said})
    slips = 1 if len(said) < _LONG else 2
    close = process.extractOne(said, known, scorer=OSA.distance, score_cutoff=slips)
    return f" (did you mean {close[0]!r}?)" if close and len(said) > _SHORT else ""


def nearest(names: Sequence[str], phrase: str) -> str:
    """At most five of the names, those first that are most like the phrase."""
    like = {name: fuzz.ratio(phrase.casefold(), name.replace("_", " ")) for name in names}
    order = sorted(names, key=lambda n: -like[n] if like[n] >= _NEAR else 0)
    shown = listed(order[:_SHOWN])
    return f"{shown}, …" if len(names) > _SHOWN else shown


def listed(names: Iterable[str]) -> str:
    """The names with commas, or `none yet`."""
    return ", ".join(names) or "none yet"


def one_of(names: Iterable[str]) -> str:
    """`a or b`, `a, b or c`."""
    several = list(names)
    return " or ".join([", ".join(several[:-1]), several[-1]] if several[1:] else several)
