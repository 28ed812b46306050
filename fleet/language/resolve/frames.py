"""What stands behind a verb, sorted, and the uses of the verb that it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import NoUse, listed
from fleet.language.tagging.skill_words import SKILL, SkillFrame
from fleet.language.tagging.tagger import Lexeme, Tagger
from fleet.language.tree.nodes import (
    Argument,
    Contrast,
    Except,
    Nouns,
    Particle,
    Place,
)
from fleet.language.words.tokens import Phrase

HOME_HINT = 'give it one with the field "home" of the object'
EXAMPLE = 'say it like "bring the first cup to the hallway" or "send a robot to the kitchen"'
ASK_IT = 'ask it like "where is the first cup?" or "is the door open?"'
SAY_IT = 'say it like "the first cup is in the kitchen" or "nobody knows where the book is"'


@dataclass(frozen=True)
class Frame:
    """What stands behind a verb, sorted: noun phrases, phrases of place, particles."""

    verb: str
    senses: frozenset[str]
    themes: tuple[Nouns, ...]
    places: tuple[Place, ...]
    particles: tuple[Particle, ...] = ()
    apart: bool = False
    """Whether a particle stands behind the thing: "put the cups away"."""
    trails: bool = False
    """Whether one ends it behind a phrase of place: "put the cup on the desk away"."""

    @property
    def home(self) -> bool:
        """Whether a word says "home"."""
        return any("HOME" in p.lexeme.tags for p in self.particles) or any(
            place.special == "home" for place in self.places
        )

    @property
    def particle_words(self) -> frozenset[str]:
        """The particles that are left beside the verb's own."""
        return frozenset(p.lexeme.word for p in self.particles if "HOME" not in p.lexeme.tags)


def framed(
    arguments: Sequence[Argument], verb: str = "", senses: frozenset[str] = frozenset()
) -> Frame:
    """The arguments of a clause, sorted."""
    themes = [a for a in arguments if isinstance(a, Nouns)]
    gone = [a.what for a in arguments if isinstance(a, Contrast) and isinstance(a.what, Nouns)]
    at = [i for i, a in enumerate(arguments) if isinstance(a, Place) and a.nouns is not None]
    if themes and gone:  # "a mug, not the red one"
        themes[-1] = _unlike(themes[-1], gone[0])
    elif at and gone:  # "turn on the radio, but not the TV"
        place = arguments[at[-1]]
        assert isinstance(place, Place) and place.nouns is not None
        of = replace(place, nouns=_unlike(place.nouns, gone[0]))
        rest = [a for a in arguments if not (isinstance(a, Contrast) and a.what is gone[0])]
        arguments = [of if a is place else a for a in rest]
    for contrast in (a.what for a in arguments if isinstance(a, Contrast)):
        if not any(isinstance(a, type(contrast)) and a != contrast for a in arguments):
            raise NotUnderstood("'not' leaves something out, and it is not said of what")
    for left_out in (a for a in arguments if isinstance(a, Except)):
        if not themes:
            raise NotUnderstood("'except' leaves something out, and it is not said of what")
        last = replace(themes[-1].items[-1], but=left_out.nouns)
        themes[-1] = replace(themes[-1], items=(*themes[-1].items[:-1], last))
    kinds = [type(a) for a in arguments if isinstance(a, Nouns | Particle)]
    return Frame(
        verb,
        senses,
        tuple(themes),
        tuple(a for a in arguments if isinstance(a, Place)),
        tuple(a for a in arguments if isinstance(a, Particle)),
        kinds[:1] == [Nouns] and Particle in kinds,
        bool(arguments)
        and isinstance(arguments[-1], Particle)
        and any(isinstance(a, Place) for a in arguments),
    )


def _unlike(nouns: Nouns, what: Nouns) -> Nouns:
    return replace(nouns, items=(*nouns.items[:-1], replace(nouns.items[-1], unlike=what)))


def frames_of(
    tagger: Tagger, verb: Lexeme, arguments: Sequence[Argument], forms: tuple[str, ...]
) -> list[tuple[Frame, list[SkillFrame]]]:
    """The uses of a verb that its particles and prepositions fit, the longest first."""
    found: list[tuple[int, Frame, list[SkillFrame]]] = []
    plain = framed(arguments, verb.word)
    for head in tagger.verbs.heads(verb.words, *forms):
        for entry in tagger.verbs.entries[head]:
            fitted = _fitted(plain, entry.behind, entry.senses, entry.base)
            if fitted is not None:
                skills = tagger.verbs.skills.get((head, entry.behind), [])
                of_skill = skills if SKILL in entry.senses else []
                found.append((len(entry.behind), fitted, of_skill))
    longest = max((row[0] for row in found), default=0)
    found.sort(key=lambda row: not any(frame.phrase.says for frame in row[2]))
    return [(frame, skills) for length, frame, skills in found if length == longest]


def _fitted(
    frame: Frame, behind: Sequence[Phrase], senses: frozenset[str], verb: str
) -> Frame | None:
    """The frame as that of a verb with these words behind it; `None`: they are not there."""
    left = list(frame.particles)
    places = list(frame.places)
    themes = frame.themes
    for i, chunk in enumerate(behind):
        one = next((p for p in left if p.lexeme.words == chunk), None)
        rest = tuple(word for later in behind[i:] for word in later)
        if one is not None:
            left.remove(one)
            continue
        at = next((p for p in places if tuple(p.preposition.split()) == rest), None)
        if at is None or (themes and senses & {"find", SKILL}):
            return None
        if senses & {"find", SKILL} and not themes and at.nouns is not None:
            places.remove(at)
            themes = (at.nouns,)
        break
    return Frame(verb, senses, themes, tuple(places), tuple(left), frame.apart, frame.trails)


def no_use(tagger: Tagger, verb: Lexeme, said: str) -> NoUse:
    """A verb is known, but not with what stands behind it: "turn left"."""
    heads = tagger.verbs.heads(verb.words, "VERB", "FIN", "GER")
    uses = sorted({entry.base for head in heads for entry in tagger.verbs.entries[head]})
    return NoUse(f"{said!r} is not understood as a goal; known are {listed(uses)}")


def nothing_said(said: str, mode: str) -> NotUnderstood:
    """A clause says nothing that is read, where all, or only a fact (`mode`), would be."""
    if mode == "fact":
        return no_fact(said)
    return NotUnderstood(f"{said!r} is not understood as a goal: {EXAMPLE}")


def said_of(refusal: str, what: str, hint: str) -> str:
    """A refusal that shows how to say a goal, where `what` was to be said: `hint` shows how."""
    if not refusal.endswith(EXAMPLE):
        return refusal
    said = refusal.removesuffix(EXAMPLE)
    before, not_as, behind = said.rpartition("is not understood as a goal")
    return f"{before}is not understood as {what}{behind}{hint}" if not_as else f"{said}{hint}"


def no_fact(said: str, word: str = "") -> NotUnderstood:
    """A clause tells nothing that a fact can say; `word`: the one of it that is at fault."""
    shown = f"{word!r} in {said!r}" if word not in ("", said) else f"{said!r}"
    return NotUnderstood(f"{shown} is not understood as a fact: {SAY_IT}")
