"""The furnished flat with skills that have words of their own, states, and somebody who speaks."""

from __future__ import annotations

from dataclasses import replace

from fleet.language import Ambiguity, Reading, SkillPhrase
from fleet.language.vocabulary import StateWord
from keyexpr_schema.facts import FactKey
from tests.support.language_flat import FURNISHED

_WASHABLE = "cup | bowl"
SPOKEN = replace(
    FURNISHED,
    speaker="anna",
    skill_phrases=(
        *FURNISHED.skill_phrases,
        SkillPhrase(
            verb="wash",
            type=_WASHABLE,
            wants=(("clean", True),),
            says=("clean {thing}", "rinse {thing} [off] [with {tool}]"),
        ),
        SkillPhrase(
            verb="vacuum",
            type="place",
            wants=(("vacuumed", True),),
            says=("hoover {place}",),
        ),
    ),
    state_words=(
        *FURNISHED.state_words,
        StateWord(word="clean", type=_WASHABLE, relation="clean", value=True),
        StateWord(word="dirty", type=_WASHABLE, relation="clean", value=False),
    ),
    believed={
        FactKey("is_open", "fridge"): True,
        FactKey("is_open", "cupboard"): False,
        FactKey("is_on", "lamp"): True,
        FactKey("clean", "cup_1"): False,
        FactKey("clean", "cup_2"): True,
    },
)


def told(reading: Reading | Ambiguity) -> str:
    """What was understood, with times and who does it; `asks …` of an ambiguity."""
    if isinstance(reading, Ambiguity):
        return "asks " + " | ".join(words for words, _ in reading.candidates)
    return reading.understood_as
