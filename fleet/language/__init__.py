"""From plain sentences to goals, facts and questions, by grammar and the names that exist.

Words are looked up among the labels, aliases, kinds and ordinals of the places, objects and robots
that exist. Every word must be used by the grammar; what is not understood is refused with a
sentence that says which words those are and what is known. `docs/language.md` has the grammar.
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from fleet.language.configuration import Confirm as Confirm
    from fleet.language.configuration import LanguageConfig as LanguageConfig
    from fleet.language.configuration import load_language_config as load_language_config
    from fleet.language.reading import Ambiguity as Ambiguity
    from fleet.language.reading import Reading as Reading
    from fleet.language.reading import WantedGoal as WantedGoal
    from fleet.language.resolve.scene import Question as Question
    from fleet.language.texts import read as read
    from fleet.language.texts import read_goal as read_goal
    from fleet.language.texts import statement_facts as statement_facts
    from fleet.language.vocabulary import SkillPhrase as SkillPhrase
    from fleet.language.vocabulary import Vocabulary as Vocabulary
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "configuration": "Confirm LanguageConfig load_language_config",
            "reading": "Ambiguity Reading WantedGoal",
            "resolve.scene": "Question",
            "texts": "read read_goal statement_facts",
            "vocabulary": "SkillPhrase Vocabulary",
        },
    )
