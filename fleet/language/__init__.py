"""From plain sentences to goals, facts and questions, by grammar and the names that exist.

Words are looked up among the labels, aliases, kinds and ordinals of the places, objects and robots
that exist. Every word must be used by the grammar; what is not understood is refused with a
sentence that says which words those are and what is known. `docs/language.md` has the grammar.
"""

from fleet.language.configuration import Confirm, LanguageConfig, load_language_config
from fleet.language.reading import Ambiguity, Reading, WantedGoal
from fleet.language.resolve.scene import Question
from fleet.language.texts import read, read_goal, statement_facts
from fleet.language.vocabulary import SkillPhrase, Vocabulary

__all__ = [
    "Ambiguity",
    "Confirm",
    "LanguageConfig",
    "Question",
    "Reading",
    "SkillPhrase",
    "Vocabulary",
    "WantedGoal",
    "load_language_config",
    "read",
    "read_goal",
    "statement_facts",
]
