"""From plain sentences to goals and facts, by grammar and the names that exist.

Words are looked up among the labels, aliases, kinds and ordinals of the places, objects and robots
that exist. Every word must be used by the grammar; what is not understood is refused with a
sentence that says which words those are and what is known. `docs/language.md` has the grammar.
"""

from fleet.language.goals.parser import Reading, read_goal
from fleet.language.statements.parser import statement_facts
from fleet.language.vocabulary import SkillPhrase, Vocabulary

__all__ = ["Reading", "SkillPhrase", "Vocabulary", "read_goal", "statement_facts"]
