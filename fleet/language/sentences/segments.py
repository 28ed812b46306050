"""A text cut into sentences, and these into parts that are parsed by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fleet.language.sentences.ordering import ordered
from fleet.language.sentences.rewording import (
    asked,
    carried_on,
    commas,
    if_so,
    marked,
    opened,
    thought,
    without_fillers,
)
from fleet.language.tagging.tagger import Lexeme
from fleet.language.words.times import TimePhrase

_OPENING = frozenset({"SAME", "KEEP", "ENSURE", "WANT", "DONT", "NEVER", "AVOID"})
_CLAUSAL = _OPENING | {"VERB", "FIN", "GER", "BE", "MODAL", "HAVE", "PREP", "CAUSE", "BELONG"}
_ENDS = frozenset({"NOUN", "PRON", "NUM", "ADJ", "PART", "HERE", "HOME", "ANYWHERE", "THERE"})
"""What a condition can end with, where no comma ends it."""
_NOW = frozenset({("now",), ("right", "now")})
_CONDITIONS = {"IF": "if", "WHEN": "when", "UNLESS": "unless", "WHENEVER": "whenever"}
_CONDITIONS |= {"ASLONGAS": "as long as"}


@dataclass(frozen=True)
class Segment:
    """Words that are parsed together.

    `joint` is what stands before them: "", "and", "then", or "sooner" ("but first"). `role`: `if`,
    `when`, `whenever`, `unless` or `as long as` for a condition, else "".
    """

    words: tuple[Lexeme, ...]
    joint: str = ""
    role: str = ""
    always: bool = False
    negated: bool = False
    """Whether a condition says what does not hold."""
    topic: bool = False
    """Whether it only names what the next part is about."""


@dataclass(frozen=True)
class Sentence:
    """One sentence: its parts, and what was said of time and haste anywhere in it."""

    words: tuple[Lexeme, ...]
    segments: tuple[Segment, ...]
    times: tuple[TimePhrase, ...] = ()
    urgent: int = 0
    dangling: bool = False
    """Whether it ends with an "and" or "then" that nothing follows."""
    time_words: str = ""
    telegraphic: bool = False
    """Whether it has no articles: "toys in box" are all the toys."""
    otherwise: bool = False
    """Whether it is for when the condition of the one before does not hold."""
    once_more: bool = False
    """Whether it is the one before, under another of the conditions of which one is enough."""

    @property
    def is_apart(self) -> bool:
        """Whether it has times or conditions of its own."""
        return self.otherwise or bool(self.times) or any(part.role for part in self.segments)

    @property
    def goes_on(self) -> bool:
        """Whether it begins with "then", and belongs to the goal before it."""
        return not self.is_apart and any(part.joint == "then" for part in self.segments[:1])


def sentences_of(lexemes: Sequence[Lexeme]) -> list[tuple[Lexeme, ...]]:
    """The words of each sentence; "no. 2" does not end one."""
    found: list[tuple[Lexeme, ...]] = []
    begun: list[Lexeme] = []
    for i, word in enumerate(lexemes):
        if "END" not in word.tags:
            begun.append(word)
            continue
        numbered = (
            word.word == "."
            and begun
            and "NUMBERSIGN" in begun[-1].tags
            and i + 1 < len(lexemes)
            and "NUM" in lexemes[i + 1].tags
        )
        if not numbered and begun:
            if len(begun) == 1 and "NUM" in begun[0].tags and begun[0].text.isdecimal():
                # "1. Wash the pan. 2. Put it away."
                begun = [replace(begun[0], tags=frozenset({"THEN"}))] if found else []
                continue
            found.append(tuple(begun))
            begun = []
    return [*found, tuple(begun)] if begun else found


def parted(words: tuple[Lexeme, ...]) -> list[tuple[Lexeme, ...]]:
    """A sentence as several, where parts of it have times or conditions of their own."""
    at = next(
        (
            i
            for i, w in enumerate(words)
            if i and "OTHERWISE" in w.tags and "EVERYTHING" not in words[i - 1].tags
        ),
        None,
    )
    if at is not None:
        before = words[:at]
        while before and (before[-1].tags & {"COMMA", "AND"} or before[-1].words == ("but",)):
            before = before[:-1]
        return [*parted(before), *parted(words[at:])]
    found, begun = [], 0
    for i, word in enumerate(words):
        if not word.tags & {"AND", "COMMA"} or i < begun + 2:
            continue
        rest = words[i + 1 + (i + 1 < len(words) and "AND" in words[i + 1].tags) :]
        before = words[begun:i]
        apart = _of_its_own(before) and _of_its_own(rest) and _opens_after_time(rest)
        fronted = bool(before[0].tags & {"TIME", *_CONDITIONS})
        apart = apart and not _on_finding(rest) and not (fronted and _only_if_behind(rest))
        if apart or _goes_on_if(before, rest):
            found.append(words[begun:i])
            begun = len(words) - len(rest)
    return [*found, words[begun:]]


def _on_finding(words: Sequence[Lexeme]) -> bool:
    """Whether it ends with "if you find it", which goes on from a search that comes before."""
    at = next((i for i, word in enumerate(words) if i and set(_CONDITIONS) & word.tags), None)
    return at is not None and any("PEOPLE" in word.tags for word in words[at + 1 : at + 2])


def _only_if_behind(words: Sequence[Lexeme]) -> bool:
    """Whether it has no time of its own, but a condition at its end: what stands before the first
    part goes for it, too."""
    given = [i for i, word in enumerate(words) if set(_CONDITIONS) & word.tags]
    return bool(given) and given[0] > 0 and not any("TIME" in word.tags for word in words)


def _goes_on_if(before: Sequence[Lexeme], rest: Sequence[Lexeme]) -> bool:
    """Whether a condition for what follows it stands behind a deed: "…, and if it is open, …"."""
    given = set(_CONDITIONS)
    first = next((word for word in before if "POLITE" not in word.tags), before[0])
    deed = any("VERB" in word.tags for word in before) and not first.tags & (given | {"ASK"})
    return deed and bool(rest) and bool(rest[0].tags & given) and _of_its_own(rest)


def _of_its_own(words: Sequence[Lexeme]) -> bool:
    """Whether it has a time, or a condition, and more than that."""
    timed = any("TIME" in word.tags or word.words in _NOW for word in words)
    given = any(set(_CONDITIONS) & word.tags and "NOUN" not in word.tags for word in words)
    said = [word for word in words if not word.tags & {"TIME", "POLITE", "COMMA"}]
    if said and "ASK" in said[0].tags:
        return False
    if said and set(_CONDITIONS) & said[0].tags and words[0] is said[0]:
        # Up to its comma it is the condition for what follows: "if …, bring it in ten minutes".
        ends = (i for i, word in enumerate(words) if word.tags & {"COMMA", "THEN"})
        end = next(ends, _command_after(words) or len(words))
        return any("VERB" in word.tags for word in words[end:])
    return (timed or given) and any(w.tags & _CLAUSAL for w in words if "TIME" not in w.tags)


def _opens_after_time(words: Sequence[Lexeme]) -> bool:
    rest = [word for word in words if not word.tags & {"TIME", "POLITE", "COMMA"}]
    return bool(rest) and bool(set(_CONDITIONS) & rest[0].tags or "VERB" in rest[0].tags)


def asking(words: Sequence[Lexeme]) -> list[Lexeme]:
    """The words of a statement as those of a question whether it is so."""
    return [replace(words[0], tags=frozenset({"ASKIF"}), last=words[0].first), *words]


def cut(words: Sequence[Lexeme]) -> Sentence:
    """A sentence cut where that is clear: at "then", and before verbs that begin a clause."""
    given = tuple(words)
    if otherwise := bool(words) and "OTHERWISE" in words[0].tags:
        words = commas(words[1:])
        while words and words[0].tags & {"COMMA"}:
            words = words[1:]
    times: list[TimePhrase] = []
    urgent = 0
    kept: list[Lexeme] = []
    words = list(marked(opened(words)))
    for i, word in enumerate(words):
        if "TIME" in word.tags and word.time is not None:
            times.append(word.time)
        elif "HOWOFTEN" in word.tags:
            times.append(TimePhrase("often"))
        elif "ONLY" in word.tags and any("TIME" in w.tags for w in words[max(i - 1, 0) : i + 2]):
            continue
        elif "URGENT" in word.tags:
            urgent = 1
        elif "LATER" in word.tags:
            urgent = urgent or -1
        elif "POLITE" not in word.tags or word.tags & {"NOUN"}:
            kept.append(word)
    kept = carried_on(asked(if_so(thought(without_fillers(kept)))))
    while kept and (kept[0].words == ("but",) or "COMMA" in kept[0].tags):
        kept.pop(0)  # "no rush, but …"
    segments: list[Segment] = []
    if kept and "OF" in kept[0].tags and (among := _among(kept)):  # "of the mugs, bring me …"
        segments.append(Segment(tuple(kept[1:among]), topic=True))
        kept = commas(kept[among:])
    for role, part in _roles(ordered(commas(kept))):
        joint, begun = "", list[Lexeme]()
        for i, word in enumerate(part):
            rest = part[i + 1 :]
            if word.tags & {"THEN", "SOONER"} and "NOUN" not in word.tags:
                segments += _segment(begun, joint, role)
                joint, begun = "then" if "THEN" in word.tags else "sooner", []
            elif "COMMA" in word.tags and _is_front(begun) and _opens(rest, begun):
                begun.append(word)
            elif (word.tags & {"AND", "COMMA"} and _clausal(begun) and _opens(rest, begun)) or (
                "COMMA" in word.tags and begun and _about_it(rest)
            ):
                segments += _segment(begun, joint, role)
                joint, begun = "and", []
            elif "WITHOUT" in word.tags and begun:
                segments += _segment(begun, joint, role)
                joint, begun = "and", [word]
            elif word.tags & {"AND", "COMMA"} and not begun:
                joint = joint or ("and" if "AND" in word.tags else "")
            else:
                begun.append(word)
        if not begun and joint == "then" and segments and part and "THEN" in part[-1].tags:
            segments[-1] = replace(segments[-1], joint="then")  # "… after that."
            joint = ""
        segments += _segment(begun, joint, role)
        dangling = not _content(begun) and joint in ("then", "and")
        dangling = dangling or bool(begun and "AND" in begun[-1].tags)
    segments = _each_time(segments)
    if (
        len(segments) > 1 and not segments[0].role and not segments[0].topic
    ):  # "that blanket on the couch, fold it"
        about = any("PRON" in word.tags for word in segments[1].words)
        plain = not any(word.tags & (_CLAUSAL - {"PREP"}) for word in segments[0].words)
        segments[0] = replace(segments[0], topic=about and plain)
    telegraphic = not any(word.tags & {"DET", "INDEF"} for word in words)
    named = " ".join(word.text for word in words if word.tags & {"TIME", "HOWOFTEN"})
    return Sentence(
        given, tuple(segments), tuple(times), urgent, dangling, named, telegraphic, otherwise
    )


def _each_time(segments: Sequence[Segment]) -> list[Segment]:
    """ "Always close the fridge when it is open" is said of each time that it is, not of once; what
    always *is* so under a condition is left to be refused."""
    given = any(segment.role in ("when", "if", "whenever") for segment in segments)
    if not given or not any(segment.always for segment in segments):
        return list(segments)
    return [
        replace(each, role="whenever")
        if each.role in ("when", "if")
        else replace(each, always=each.always and "VERB" not in each.words[0].tags)
        for each in segments
    ]


def _content(words: Sequence[Lexeme]) -> list[Lexeme]:
    return [word for word in words if not word.tags & {"COMMA", "AND"}]


def _among(words: Sequence[Lexeme]) -> int | None:
    """Where those end of whom something is said: "of the two towels | bring me …"."""
    return next(
        (
            i
            for i, word in enumerate(words)
            if i > 1 and ("COMMA" in word.tags or ("VERB" in word.tags and "NOUN" not in word.tags))
        ),
        None,
    )


def _clausal(words: Sequence[Lexeme]) -> bool:
    """Whether it is more than a name that somebody is called by, or "first"."""
    return any(w.tags & _CLAUSAL and not w.tags & {"NOUN"} for w in words)


def _is_front(words: Sequence[Lexeme]) -> bool:
    """Whether it is a phrase before what shall be done: "in the kitchen, close …"."""
    return bool(words) and "PREP" in words[0].tags and not any(
        word.tags & (_CLAUSAL - {"PREP"}) and not word.tags & {"NOUN", "PREP"} for word in words
    )  # fmt: skip


def _about_it(rest: Sequence[Lexeme]) -> bool:
    """Whether what follows says something of what was named: "the curtains, they should …"."""
    return len(rest) > 2 and "PRON" in rest[0].tags and bool(
        rest[1].tags & {"MODAL", "BE", "NEEDS", "HAVE", "BELONG"}
    )  # fmt: skip


def _opens(rest: Sequence[Lexeme], before: Sequence[Lexeme]) -> bool:
    """Whether what follows begins a clause, and cannot go on with a list; none goes on with what
    calls a task."""
    rest = list(rest[:2])
    if rest and rest[0].tags & {"AND", "COMMA"}:
        rest = rest[1:]
    if not rest:
        return False
    if len(rest) > 1 and "ORD" in rest[0].tags and "VERB" in rest[1].tags:
        rest = rest[1:]
    tags = rest[0].tags
    if tags & _OPENING:
        return True
    return "VERB" in tags and ("TASK" in before[-1].tags or not tags & {"NOUN", "ADJ", "ORD"})


def _roles(words: Sequence[Lexeme]) -> list[tuple[str, list[Lexeme]]]:
    """A sentence with "if", "when" or "unless" cut into condition and the rest."""
    if any(set(_CONDITIONS) & word.tags for word in words):
        words = [word for word in words if "ONLY" not in word.tags]
    for i, word in enumerate(words):
        role = next((_CONDITIONS[tag] for tag in sorted(word.tags) if tag in _CONDITIONS), None)
        if role is None:
            continue
        if not commas(words[i + 1 :]) or (not i and "COMMA" in words[1].tags):
            break  # "close it every time": each time that what?
        if i:
            return [("", list(words[:i])), (role, list(words[i + 1 :]))]
        end = next(
            (j for j in range(1, len(words)) if words[j].tags & {"COMMA", "THEN"}),
            None,
        )
        if end is not None:
            rest = list(words[end + 1 :])
            if rest and "THEN" in rest[0].tags:
                rest = rest[1:]
            return [(role, list(words[1:end])), *_roles(rest)]
        if (end := _command_after(words)) is not None:
            return [(role, list(words[1:end])), *_roles(words[end:])]
    if words and words[0].words == ("should",):  # "should the door be open, close it"
        end = next((j for j, word in enumerate(words) if "COMMA" in word.tags), None)
        if end is not None:
            return [("if", list(words[:end])), ("", list(words[end + 1 :]))]
    return [("", list(words))]


def _command_after(words: Sequence[Lexeme]) -> int | None:
    """Where what is to be done begins behind a condition that no comma ends: "if you find it bring
    it here"."""
    for i in range(3, len(words) - 1):
        before = words[i - 1].tags
        if "VERB" in words[i].tags and "NOUN" not in words[i].tags and before & _ENDS:
            return i
    return None


def _segment(words: Sequence[Lexeme], joint: str, role: str) -> list[Segment]:
    words = commas(words)
    if len(words) > 1 and words[0].words == ("1st",) and "COMMA" in words[1].tags:
        words = words[2:]
    while words and words[-1].tags & {"AND", "COMMA"}:
        words = words[:-1]
    numbered = words and "ORD" in words[0].tags and "NOUN" not in words[0].tags
    if numbered:
        following = words[1].tags if len(words) > 1 else frozenset()
        after = words[2].tags if len(words) > 2 else frozenset()
        verbal = "VERB" in following and (
            "NOUN" not in following or bool(after & {"DET", "INDEF", "UNIV", "NUM"})
        )
        if verbal and words[0].words != ("1st",):
            joint = "then"
        if following & ({"COMMA", "GER"} | _OPENING) or verbal:
            words = commas(words[1:])
    always = any("ALWAYS" in word.tags for word in words)
    words = [word for word in words if "ALWAYS" not in word.tags]
    return [Segment(tuple(words), joint, role, always)] if words else []
