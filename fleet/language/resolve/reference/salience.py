"""Of several who could be meant, those of whom the text speaks."""

from __future__ import annotations

from dataclasses import replace

from fleet.language.resolve.reference.mentions import NounPhrase
from fleet.language.resolve.scene import Scene
from fleet.language.tree.nodes import Quantity


class Salience:
    """Narrows noun phrases down by what the text has spoken of."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def meant(self, made: NounPhrase) -> NounPhrase:
        """The same, of those only who were spoken of, or are where somebody was just sent."""
        if made.generic and made.type == "place":
            made = self._room_spoken_of(made)
        meant = self._where_sent(self._salient(self._spoken_briefly(made)))
        return meant if meant.found == made.found else replace(meant, wider=made.found)

    def listed(self) -> tuple[str, ...]:
        """Things that the text has named, one after the other: "everything" may be those."""
        names = {n for m in self.scene.said.mentioned if m.type == "object" for n in m.subjects}
        things = tuple(n for n in self.scene.vocabulary.objects if n in names)
        several = len(things) > 1 and not any(m.open for m in self.scene.said.mentioned)
        return things if several else ()

    def _room_spoken_of(self, made: NounPhrase) -> NounPhrase:
        """`the room`: the one that was spoken of, or in which what was spoken of is."""
        said, place_of = self.scene.said, self.scene.vocabulary.place_of
        if made.quantity is not Quantity.THE or made.plural or made.source is not None:
            return made
        spoken = [said.last_place] if said.last_place else []
        spoken += [m.subjects[0] for m in said.recent if m.single and not m.open]
        rooms = {place_of(name) for name in spoken} & set(made.names)
        return made.among([name for name in rooms if name]) if len(rooms) == 1 else made

    def _where_sent(self, made: NounPhrase) -> NounPhrase:
        """Of several, those where somebody was just sent: "go to room 102, turn the light off"."""
        if made.quantity is not Quantity.THE or made.plural or made.source is not None:
            return made
        place = self.scene.said.draft.sent_to()
        if made.ordinal is not None or len(made.names) < 2 or place is None:
            return made
        is_at = self.scene.vocabulary.is_at
        there = made.among([name for name in made.names if is_at(name, place)])
        return there if there.found else made

    def _spoken_briefly(self, made: NounPhrase) -> NounPhrase:
        """Bare plurals of a sentence without articles are all of them: "lights off"."""
        bare = made.plural and made.quantity is Quantity.BARE and made.count is None
        if bare and self.scene.said.telegraphic and self.scene.mode == "":
            return replace(made, quantity=Quantity.ALL)
        return made

    def _salient(self, made: NounPhrase) -> NounPhrase:
        """Of several, the one that was spoken of: "the plate" after "plate 2"."""
        definite = made.quantity is Quantity.THE or (
            made.quantity is Quantity.BARE and self.scene.said.telegraphic and not self.scene.mode
        )
        if not definite or made.plural or made.source is not None:
            return made
        if made.ordinal is not None or made.count is not None or len(made.names) < 2:
            return made
        named = {subjects for subjects in self.scene.said.named if set(subjects) & set(made.names)}
        if any(len(subjects) > 1 for subjects in named):
            return made
        return made.among([name for (name,) in named]) if named else made
