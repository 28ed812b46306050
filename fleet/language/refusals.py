"""Why a sentence is refused, in one sentence that says what would be right."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

from rapidfuzz import fuzz, process
from rapidfuzz.distance import OSA

from fleet.errors import NotUnderstood
from fleet.language.words.folding import folded
from fleet.language.words.morphology import plurals

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
            "while until till during throughout",
            "says how long, or until when, which {what} cannot; what is kept or avoided is so "
            "until the goal is deleted",
        ),
        (
            "if when whenever unless once before after because since whether "
            "depending otherwise else provided",
            "makes it depend on something else, which {what} cannot; give it when it is time, "
            'or put one thing after the other with "then"',
        ),
        (
            "pm oclock o'clock clock minute minutes hour hours sec secs seconds day days week "
            "weeks weekend weekends fortnight month months monthly year years yearly annually "
            "today tomorrow tonight yesterday morning afternoon evening night noon midnight later "
            "soon sometime someday eventually daily weekly hourly monday tuesday wednesday "
            "thursday friday saturday sunday mondays tuesdays wednesdays thursdays fridays "
            "saturdays sundays mornings afternoons evenings nights always",
            'names a time, which {what} cannot, or not so; goals know times like "at 5 pm", '
            '"in ten minutes", "before noon" and "every morning"',
        ),
        (
            "again twice thrice times repeatedly forever continuously constantly",
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
        (
            "cancel abort undo",
            "takes back what was asked for, which {what} cannot: `robotctl goal delete` does, and "
            "`robotctl stop` brings robots to rest",
        ),
        ("was were had", "tells of the past; say what holds now"),
        (
            "wait linger",
            "says to stay, which {what} cannot: whoever is sent somewhere stays there until there "
            "is something else to do, so leave it out",
        ),
    )
    for word in words.split()
}
_WHY["manner"] = _WHY["gently"]
_WHY["supposed"] = "only supposes something; say what shall hold, or what holds"
SUBORDINATE = frozenset(["because", "since", "while", "until", "till", "whether", "unless"])
"""What follows these says why or when: what is not known there is of less weight."""


HOW_TO_REST = (
    "`robotctl stop --all` brings all robots to rest at once, and `robotctl pause` holds back what "
    "is to come"
)
"""What to say of a sentence by which nobody shall do anything any more."""
_LONGEST, _BEGIN, _END = 1_500, 120, 240
"""Characters of a refusal; of a longer one, those that are kept."""


def shortened(sentence: str) -> str:
    """A refusal without the middle of a very long text that it quotes."""
    if len(sentence) <= _LONGEST:
        return sentence
    return f"{sentence[:_BEGIN]} … {sentence[-_END:]}"


def nothing_of_it(strange: str, whole: str, called: Iterable[str]) -> NotUnderstood:
    """Of a known kind something is said that nobody knows of any: "the purple book"."""
    return NotUnderstood(
        f"{strange!r} in {whole!r} is nothing that is known of it; known are "
        f"{listed(dict.fromkeys(called))}"
    )


class Misused(NotUnderstood):
    """A known word in a use that nobody knows: it weighs as much as an unknown word."""


class NoUse(Misused):
    """A verb is known, but not with what stands behind it, as far as one reading has it."""


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


def suggestion(phrase: str, names: Iterable[str], everyday: Container[str] = ()) -> str:
    """` (did you mean 'hallway'?)` for a slip of the pen, else nothing.

    One letter of a short word may be wrong or two neighbours swapped, two in a long one; nobody
    errs in the first letter but by swapping it. A word of `everyday` speech is no slip for another,
    and where two names are equally near, neither is meant.
    """
    said = folded(phrase)
    if len(said) <= _SHORT or any(form in everyday for form in _base_forms(said)):
        return ""
    slips = 1 if len(said) < _LONG else 2
    known = sorted({name for name in names if name != said and _begins_alike(said, name)})
    close = process.extract(said, known, scorer=OSA.distance, score_cutoff=slips, limit=2)
    if not close or (len(close) > 1 and close[0][1] == close[1][1]):
        return ""
    if said in plurals(close[0][0]):
        return ""  # one in place of all would be another goal
    return f" (did you mean {close[0][0]!r}?)"


def _begins_alike(said: str, name: str) -> bool:
    return said[:1] == name[:1] or said[:2] == name[1::-1]


def _base_forms(word: str) -> set[str]:
    """What a word may be a form of: "packs", "packed", "packing" of "pack"."""
    endings = ("s", "es", "d", "ed", "ing", "r", "er", "st", "est", "ly", "y")
    stems = {word.removesuffix(ending) for ending in endings}
    return stems | {f"{stem}e" for stem in stems}


def nearest(names: Sequence[str], phrase: str) -> str:
    """At most five of the names, those first that are most like the phrase."""
    like = {name: fuzz.ratio(folded(phrase), name.replace("_", " ")) for name in names}
    return listed(sorted(names, key=lambda n: -like[n] if like[n] >= _NEAR else 0))


def alike(phrases: Iterable[str], phrase: str) -> str:
    """At most five of the phrases, in quotes, those first that are most like the phrase."""
    several = list(phrases)
    ranked = sorted(several, key=lambda known: -fuzz.WRatio(folded(phrase), known))
    shown = ", ".join(f"{known!r}" for known in ranked[:_SHOWN])
    return f"{shown}, …" if len(several) > _SHOWN else shown


def listed(names: Iterable[str]) -> str:
    """At most five of the names with commas, or `none yet`."""
    several = list(names)
    return ", ".join([*several[:_SHOWN], "…"] if several[_SHOWN:] else several) or "none yet"


def one_of(names: Iterable[str]) -> str:
    """`a or b`, `a, b or c`; of many the first five."""
    several = list(names)
    if several[_SHOWN:]:
        others = len(several) - _SHOWN
        several = [*several[:_SHOWN], "another" if others == 1 else f"one of {others} others"]
    return " or ".join([", ".join(several[:-1]), several[-1]] if several[1:] else several)
