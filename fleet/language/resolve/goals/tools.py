"""What something is done with: "slice the bread with the butter knife"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.ground import Ground
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tree.nodes import Place
from fleet.language.vocabulary import SkillPhrase
from keyexpr_schema.facts import Value

Wants = tuple[tuple[str, Value], ...]


class Tools:
    """Finds what holds besides when something was done with a tool that is named."""

    def __init__(self, ground: Ground) -> None:
        self.scene, self.who, self.nouns, _ = ground

    def taken(
        self, frame: Frame, frames: Sequence[SkillFrame]
    ) -> tuple[Frame, list[tuple[SkillPhrase, Wants]]]:
        """The frame without "with …"; the skills that take that, and what holds besides then.

        Raises:
            NotUnderstood: none takes it, or a plan could do it with another one.
        """
        tools = [place for place in frame.places if place.role == "with"]
        if not tools:
            return frame, [(each.phrase, ()) for each in frames]
        rest = replace(frame, places=tuple(p for p in frame.places if p not in tools))
        named = [(each.phrase, each.tool) for each in frames if each.tool]
        text = self.scene.said.quote(tools[-1].first, tools[-1].last)
        if not named or len(tools) > 1:
            raise NotUnderstood(
                f"{text!r}: nothing can be named with which {frame.verb!r} is done: leave it out"
            )
        problems, found = [], []
        for phrase, tool in named:
            try:
                found.append((phrase, self._wants(tools[0], text, phrase, tool)))
            except NotUnderstood as problem:
                problems.append(problem)
        if not found:
            raise problems[0]
        return rest, found

    def _wants(self, place: Place, text: str, phrase: SkillPhrase, parameter: str) -> Wants:
        tool = next(each for each in phrase.tools if each.name == parameter)
        able = sorted(self.scene.vocabulary.of_type(tool.type))
        assert place.nouns is not None
        (subject, *more) = self.nouns.subjects(place.nouns, ("object",), "an object")
        mention = self.who.resolve(subject)
        if stray := [name for name in mention.subjects if name not in able]:
            raise NotUnderstood(
                f"{text!r}: {stray[0]} is nothing to {phrase.verb} with; known are {listed(able)}"
            )
        if set(mention.subjects) == set(able) and (mention.open or len(able) == 1) and not more:
            return ()  # it cannot be done with another
        if more or len(mention.subjects) > 1:
            raise NotUnderstood(f"{text!r}: it is done with one thing: say which")
        if not tool.relation:
            effect = f"{phrase.verb.split()[0]}_with(…) = {parameter}"
            raise NotUnderstood(
                f"{text!r}: no effect of {phrase.verb!r} says with what it was done, so another "
                f"may be taken; leave it out, or have the skill say so: `after: [{effect}]`"
            )
        return ((tool.relation, mention.subjects[0]),)
