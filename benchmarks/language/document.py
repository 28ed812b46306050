"""Writes the tables of docs/language.md: `python -m benchmarks.language.document`.

What verbs, words and skills there are comes from the data that the reader works with, and what
sentences mean from the reader itself: sentences of the suite, read in the world of each.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from benchmarks.language.entries import KINDS, load_suite
from benchmarks.language.reader import Answer, AskedBack, Read, answer
from fleet.core.model.skills import SkillModel, phrases_of, state_words_of
from fleet.language.words.own_words import shipped_verbs, shipped_words
from fleet.language.words.tokens import words_in
from fleet.service.skill_models import load_skills
from keyexpr_schema.config_files import config_file

PAGE = Path(__file__).parents[2] / "docs" / "language.md"
SENSES = {
    "move": "`at(X) = PLACE`, or on, in, with *THING* or *PERSON*",
    "fetch": "the same; where to may be said later, and in, on say where *X* is",
    "put": "the same; in, on say where *X* goes",
    "give": "`at(X) = PERSON` or `ROBOT`",
    "go": "`at(ROBOT) = PLACE`",
    "pick": "`held(X) = true`",
    "hold": "the same, if it says no more",
    "find": "`located(X) = true`",
    "search": "`searched(PLACE) = true`",
    "patrol": "the same, or from place to place where one robot is named",
    "tidy": "`at(X) = home`",
    "clear": "what lies on it is at home",
    "bin": "`in(X)` = the bin",
}
"""What shall hold after verbs of a sense."""
TAGS = {
    "POLITE": "change nothing",
    "URGENT": "come before other goals",
    "LATER": "let others go first",
    "THEN": "begin a new stage",
    "WANT": "what is wanted",
    "ENSURE": "what shall be so",
    "KEEP": "what shall stay so",
    "ALWAYS": "what shall stay so",
    "NEVER": "what must never be",
    "DONT": "what must never be",
    "AVOID": "where nobody shall be",
    "WITHOUT": "where nobody shall be",
    "IF": "a condition of the goal",
    "WHEN": "what is waited for",
    "UNLESS": "a condition, turned round",
    "BEFORE": "which comes first",
    "AFTER": "which comes first",
    "EXCEPT": "what is left out",
    "NOBODYKNOWS": "where something is, is unknown",
}
"""What words under a tag say."""
EXAMPLES = frozenset(
    words_in(
        "simple-011 simple-039 simple-061 simple-181 compound-052 compound-163 compound-039 "
        "compound-v32 complex-007 complex-030 complex-066 complex-082 complex-106 complex-113 "
        "complex-119 vague-040 vague-057 question-002 question-097 question-v11 question-v29 "
        "statement-003 statement-021 statement-025 statement-036 refusal-028 refusal-043 "
        "refusal-057 refusal-070 refusal-104 ambiguous-007 ambiguous-011"
    )
)
"""Sentences of the suite that the page shows."""
_MARKED = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_FEW = 24
"""Phrases of one tag that are shown."""


def document(page: str) -> str:
    """The page with its tables made anew."""
    made = {"verbs": _verbs, "words": _words, "skills": _skills, "sentences": _sentences}

    def table(match: re.Match[str]) -> str:
        rows = "".join(f"{line}\n" for line in made[match[2]]())
        return f"{match[1]}{rows}{match[3]}"

    return _MARKED.sub(table, page)


def _verbs() -> Iterator[str]:
    verbs = shipped_verbs()
    yield from _head("what shall hold", "verbs")
    for sense, phrases in verbs["verbs"].items():
        yield _row(SENSES[sense], ", ".join(dict.fromkeys(phrases)))
    yield ""
    yield from _head("after the verb", "prepositions")
    for role, phrases in verbs["prepositions"].items():
        yield _row(role.replace("_", " "), ", ".join(phrases))


def _words() -> Iterator[str]:
    words = shipped_words()
    yield from _head("which", "words")
    for tag, about in TAGS.items():
        several = words[tag]
        more = ", …" if len(several) > _FEW else ""
        yield _row(f"`{tag}`: {about}", ", ".join(several[:_FEW]) + more)


def _skills() -> Iterator[str]:
    skills: dict[str, SkillModel] = dict(load_skills(config_file("skills", "household")))
    yield from _head("skill", "asked for by", "what then holds", "words for states")
    states = state_words_of(skills)
    for phrase in phrases_of(skills):
        wants = ", ".join(f"{relation} = {_shown(value)}" for relation, value in phrase.wants)
        told = [s.word for s in states if (s.relation, s.value) in phrase.wants]
        said = ", ".join(f"`{says}`" for says in phrase.says) or f"`{phrase.verb} {{thing}}`"
        yield _row(f"`{phrase.skill}`", said, f"`{wants}`", ", ".join(told))


def _sentences() -> Iterator[str]:
    yield from _head("said", "read as")
    shown = [s for s in load_suite("dev", None) if s.entry.id in EXAMPLES]
    for sentence in sorted(shown, key=lambda s: KINDS.index(s.kind)):
        entry = sentence.entry
        yield _row(entry.say, _told(answer(entry.say, entry.world)))


def _told(found: Answer) -> str:
    if isinstance(found, Read):
        return f"`{found.meaning}`"
    kind = "asked back" if isinstance(found, AskedBack) else "refused"
    return f"{kind}: {found.sentence}"


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _head(*names: str) -> Iterator[str]:
    yield _row(*names)
    yield _row(*("---" for _ in names))


def _row(*cells: str) -> str:
    return f"| {' | '.join(_cells(cells))} |"


def _cells(cells: Iterable[str]) -> list[str]:
    return [cell.replace("|", "\\|") for cell in cells]


if __name__ == "__main__":
    PAGE.write_text(document(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
