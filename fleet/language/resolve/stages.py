"""From wishes, in the order in which a sentence has them, to stages of conditions."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from itertools import combinations

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.consistency import (
    check_carried,
    consistent,
    for_speaker,
    sequenced,
    without_implied_travel,
    without_means,
)
from fleet.language.resolve.reference.mentions import Mention
from fleet.language.resolve.wish import PLACED, Wish
from keyexpr_schema.facts import LOCATED, SEARCHED, Value
from keyexpr_schema.payloads.goals import Condition


@dataclass
class GoalDraft:
    """The stages of a goal while its sentence is read.

    `is_at` says whether a thing is in a place, or on or in another thing.
    """

    is_at: Callable[[str, str], bool] = lambda name, where: False
    stages: list[list[Wish]] = field(default_factory=lambda: [[]])
    by: tuple[str, ...] = ()
    """The robots that are told to do what is wished for now."""
    never: bool = False
    """Whether nothing of what is wished for now may ever be so."""
    held: list[list[Wish]] = field(default_factory=list)
    """Stages that come after what is wished for now, though they were said before."""

    @property
    def empty(self) -> bool:
        """Whether the stage that is being filled has nothing yet."""
        return not self.stages[-1]

    @property
    def last(self) -> Wish | None:
        """What was wished for last."""
        return next((stage[-1] for stage in reversed(self.stages) if stage), None)

    def sent_to(self) -> str | None:
        """Where somebody was sent last, if nothing has been taken anywhere else since."""
        for wish in (wish for stage in reversed(self.stages) for wish in reversed(stage)):
            if wish.means:
                return str(wish.value)
            if wish.relation in PLACED:
                return None
        return None

    def copy(self) -> GoalDraft:
        """The same, to go on from."""
        held = [list(stage) for stage in self.held]
        stages = [list(stage) for stage in self.stages]
        return GoalDraft(self.is_at, stages, self.by, self.never, held)

    def hold(self) -> None:
        """What comes now is wanted before what was said last."""
        self.held, self.stages = [*self.stages[-1:]], [*self.stages[:-1], []]

    def release(self) -> None:
        """What comes now is wanted after what was held."""
        if self.held:
            self.next_stage()
            self.stages[-1:] = [*filter(None, self.stages[-1:]), *self.held]
            self.held = []

    @property
    def count(self) -> int:
        """How much has been wished for."""
        return sum(map(len, self.stages))

    def take_first(self, count: int) -> GoalDraft:
        """So much of what was wished for first, taken out of this."""
        taken: list[list[Wish]] = []
        while count and self.stages:
            first = self.stages.pop(0)
            taken.append(first[:count])
            if rest := first[count:]:
                self.stages.insert(0, rest)
            count -= len(taken[-1])
        self.stages = self.stages or [[]]
        return GoalDraft(self.is_at, taken)

    def search_ahead(self) -> GoalDraft | None:
        """What is looked for before anything else is done, taken out of this, if more follows."""
        wishes = [wish for stage in self.stages for wish in stage]
        looks = [wish.relation in (LOCATED, SEARCHED) for wish in wishes]
        means = [wish.means or looked for wish, looked in zip(wishes, looks, strict=True)]
        count = next((i for i, each in enumerate(means) if not each), len(wishes))
        return self.take_first(count) if any(looks[:count]) and count < len(wishes) else None

    def next_stage(self) -> None:
        """What comes now is wanted after all that came."""
        if not self.empty:
            self.stages.append([])

    def add(
        self,
        relation: str,
        mention: Mention,
        value: Value,
        *,
        on_robot: bool = False,
        means: bool = False,
        whereto: bool = False,
        for_now: bool = False,
    ) -> None:
        """One more wish, for each of those meant, or for any of them."""
        each: tuple[tuple[str, ...], ...] = tuple((s,) for s in mention.subjects)
        each = (mention.subjects,) if mention.open else each
        if mention.least > 1:  # "two of the three": one of each pair
            each = tuple(combinations(mention.subjects, len(mention.subjects) - mention.least + 1))
        if relation not in PLACED and any(
            wish.relation == relation
            and wish.value != value
            and not wish.open
            and any((wish.subjects[0],) == subjects for subjects in each)
            for wish in self.stages[-1]
        ):  # "open the door, …, close it"
            self.next_stage()
        self.stages[-1].extend(
            Wish(
                relation,
                subjects,
                value,
                mention.key if mention.least == 1 else -(1000 * (mention.key + 1) + number),
                mention.open,
                on_robot,
                means,
                whereto,
                None if mention.type == "robot" else self.by,
                mention.least > 1,
                for_now,
            )
            for number, subjects in enumerate(each)
        )

    def narrow(self, mention: Mention, subjects: Collection[str]) -> Mention:
        """Of those whom an open mention may mean, only these will do."""
        left = tuple(s for s in mention.subjects if s in subjects)
        meant = replace(mention, subjects=left, open=len(left) > 1)
        for stage in self.stages:
            stage[:] = [
                replace(wish, subjects=left, open=meant.open) if wish.key == mention.key else wish
                for wish in stage
            ]
        return meant

    def of_each(self) -> list[tuple[tuple[str, ...], GoalDraft]]:
        """The robots that are told to do something, and what each shall do.

        Raises:
            NotUnderstood: one shall do something after another has done something.
        """
        doers = dict.fromkeys(w.by for stage in self.stages for w in stage if w.by is not None)
        if len(doers) < 2:
            return [(next(iter(doers), ()), self)]
        if sum(bool(stage) for stage in self.stages) > 1:
            named = one_of(name for by in doers for name in by)
            raise NotUnderstood(
                f"it does not say of each step whether {named} shall do it: say it step by step"
            )
        first = next(iter(doers))
        return [
            (by, GoalDraft(self.is_at, [
                [w for w in stage if (first if w.by is None else w.by) == by]
                for stage in self.stages
            ]))
            for by in doers
        ]  # fmt: skip

    def conditions(self, speaker: str | None = None) -> tuple[tuple[Condition, ...], ...]:
        """The stages, each free of contradictions and of what another wish implies.

        What was fetched, and goes nowhere, is for the `speaker`.

        Raises:
            NotUnderstood: two wishes of one stage cannot both come true.
        """
        own = without_means(self.stages)
        wished = [wish for stage in own for wish in stage]
        given = [] if speaker is None else [
            [for_speaker(wish, wished, speaker) for wish in stage] for stage in own
        ]  # fmt: skip
        stages_ = given or own
        check_carried([wish for stage in stages_ for wish in stage])
        stages = [part for stage in stages_ for part in sequenced(without_implied_travel(stage))]
        return tuple(
            tuple(dict.fromkeys(wish.condition() for wish in consistent(stage, self.is_at)))
            for stage in stages
            if stage
        )
