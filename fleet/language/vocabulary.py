"""The names that sentences can use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import msgspec

from keyexpr_schema.facts import Value
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Object, Place


class SkillPhrase(msgspec.Struct, frozen=True, kw_only=True):
    """A skill that can be asked for by name: "vacuum the hallway".

    `type` is that of what it is done to: `place`, `object`, or kinds, categories and features of
    things, as skill files write them (`openable`, `cup & clean | glass`); `wants` are the relations
    and values that hold of it then.
    """

    verb: str
    type: str = msgspec.field(name="sort")
    wants: tuple[tuple[str, Value], ...]

    def fits(self, thing: Object) -> bool:
        """Whether it can be done to a thing."""
        return any(
            all(word.strip() == "object" or thing.is_a(word.strip()) for word in words.split("&"))
            for words in self.type.split("|")
        )


@dataclass(frozen=True)
class Vocabulary:
    """Places, objects and robots that exist, by id.

    `whereabouts` may say at which place (or robot) an object is believed to be; phrases such as
    "the cup in the kitchen" or "all cups from the kitchen" are told apart by it, and "tidy up the
    kitchen" is said of what is believed to be there. `rests` may say on which surface (or `floor`)
    it is believed to lie there: "everything on the coffee table". `skill_phrases` are skills that
    can be asked for by name, where the grammar has no verb of that name.
    """

    places: Mapping[str, Place]
    objects: Mapping[str, Object]
    robots: Mapping[str, RobotSpec]
    whereabouts: Mapping[str, str] = field(default_factory=dict)
    rests: Mapping[str, str] = field(default_factory=dict)
    skill_phrases: tuple[SkillPhrase, ...] = ()
