"""Where sentences are resolved: the world, the words, and what the text has said so far."""

from __future__ import annotations

from dataclasses import dataclass

from fleet.language.resolve.discourse import Discourse
from fleet.language.resolve.reference.states import Stated
from fleet.language.tagging.lexicon import EntityType
from fleet.language.tagging.tagger import Tagger
from fleet.language.vocabulary import Vocabulary
from keyexpr_schema.payloads.goals import Condition

THINGS: tuple[EntityType, ...] = ("object", "robot")
PLACES: tuple[EntityType, ...] = ("place", "surface")
SPOTS: tuple[EntityType, ...] = ("place", "robot", "surface")


@dataclass(frozen=True)
class Question:
    """What a sentence asks: `where`, `how many`, `which`, `whether`, `what doing`, `what able`
    or `who`.

    `subjects` are those it is asked of (none: of anything), `holds` what may be so, where the
    subject `?` stands for each of them; of `what able`, what the robots would have to bring about.
    """

    of: str
    subjects: tuple[str, ...] = ()
    holds: tuple[Condition, ...] = ()


class Scene:
    """What all that resolves shares. `said` is replaced where a reading is tried and given up."""

    def __init__(
        self, vocabulary: Vocabulary, tagger: Tagger, said: Discourse, mode: str = ""
    ) -> None:
        """`mode`: only a `goal` or a `fact` is understood; else anything."""
        self.vocabulary, self.tagger, self.said, self.mode = vocabulary, tagger, said, mode
        self.lexicon = tagger.lexicon
        self.stated = Stated(vocabulary, tagger)
        self.question: Question | None = None
