"""Where things belong, and which of them are put there."""

from __future__ import annotations

from collections.abc import Sequence

from fleet.errors import NotUnderstood
from fleet.language.resolve.frames import HOME_HINT
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject


class Homes:
    """Wishes that things are where they belong."""

    def __init__(self, ground: Ground) -> None:
        self.scene = ground.scene

    def with_homes(self, subject: Subject) -> Subject:
        """Of "everything" what has a home."""
        if not isinstance(subject, NounPhrase) or not subject.generic:
            return subject
        things = self.scene.vocabulary.objects
        names = self.in_nobodys_hand([n for n in subject.names if self.is_spot(things[n].home)])
        homely = subject.among(names)
        return homely if homely.found and subject.type == "object" else subject

    def in_nobodys_hand(self, names: Sequence[str]) -> list[str]:
        """Those that no person has; that others are left with whoever has them is kept."""
        vocabulary = self.scene.vocabulary
        kept = []
        for name in names:
            around = vocabulary.carriers.get(name, ())
            person = next((each for each in around if vocabulary.is_person(each)), None)
            if person is None:
                kept.append(name)
            else:
                self.scene.said.left_out.append(f"{name} is left with {person}, who has it")
        return kept

    def home(self, mention: Mention) -> None:
        """Wish that each is where it belongs.

        Raises:
            NotUnderstood: it belongs nowhere in particular.
        """
        homes = {
            n: self.scene.vocabulary.objects[n].home
            for n in mention.subjects
            if n in self.scene.vocabulary.objects
        }
        homeless = [n for n in mention.subjects if not self.is_spot(homes.get(n))]
        if homeless or (mention.open and len(set(homes.values())) > 1):
            name = homeless[0] if homeless else mention.subjects[0]
            raise NotUnderstood(f"it is not known where {name} belongs: {HOME_HINT}")
        if mention.open:
            self.to_spot(mention, homes[mention.subjects[0]])
            return
        for name in mention.subjects:
            self.to_spot(Mention((name,), "object", mention.key), homes[name])

    def is_spot(self, name: str | None) -> bool:
        """Whether things can belong there: in a place, or on or in a thing."""
        return name in self.scene.vocabulary.places or name in self.scene.vocabulary.good_for

    def to_spot(self, mention: Mention, spot: str | None) -> None:
        """Wish that it is in that place, or on or in that thing."""
        self.scene.said.draft.add(self.scene.vocabulary.relation_to(spot or ""), mention, spot)
