"""From wishes, in the order in which a sentence has them, to stages of conditions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.reference.mentions import Mention
from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, SEARCHED, Value
from keyexpr_schema.payloads.goals import Condition

PLACED = frozenset({AT, ON, IN})
"""Relations that say where a thing is: all of one variable."""
_THEN = 'if one is to come after the other, say "then"'


@dataclass(frozen=True)
class Wish:
    """What one clause wants. `subjects` is one, or with `open` those of whom any will do.

    `means`: somebody goes somewhere in order to do what the sentence says next.
    `whereto`: it was fetched, and the sentence still has to say where to. `by`: the robots that
    shall do it (`None`: it is about where a robot itself is).
    """

    relation: str
    subjects: tuple[str, ...]
    value: Value
    key: int
    open: bool = False
    on_robot: bool = False
    means: bool = False
    whereto: bool = False
    by: tuple[str, ...] | None = ()
    shared: bool = False
    """Whether what fulfils it may fulfil another one, too: pairs of "two of the three"."""

    def condition(self) -> Condition:
        """The condition that makes it true."""
        return Condition(
            relation=self.relation,
            subject=self.subjects[0],
            value=self.value,
            any_of=self.subjects if self.open else (),
        )


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

    def search_ahead(self) -> GoalDraft | None:
        """What is looked for before anything else is done, taken out of this, if more follows."""
        searched: list[Wish] = []
        for wish in (wish for stage in self.stages for wish in stage):
            if wish.relation not in (LOCATED, SEARCHED) and not wish.means:
                break
            searched.append(wish)
        rest = [[w for w in stage if w not in searched] for stage in self.stages]
        sought = any(wish.relation in (LOCATED, SEARCHED) for wish in searched)
        if not sought or not any(rest):
            return None
        self.stages = list(filter(None, rest))
        return GoalDraft(self.is_at, [searched])

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
        wished = [wish for stage in self.stages for wish in stage]
        given = [] if speaker is None else [
            [_for_speaker(wish, wished, speaker) for wish in stage] for stage in self.stages
        ]  # fmt: skip
        stages_ = given or self.stages
        _check_carried([wish for stage in stages_ for wish in stage])
        stages = [part for stage in stages_ for part in _sequenced(_without_implied_travel(stage))]
        return tuple(
            tuple(dict.fromkeys(wish.condition() for wish in _consistent(stage, self.is_at)))
            for stage in stages
            if stage
        )


def _same(one: Wish, other: Wish) -> bool:
    if one.open or other.open:
        return one.key == other.key or (one.subjects, one.open) == (other.subjects, other.open)
    return one.subjects == other.subjects


def _check_carried(wishes: Sequence[Wish]) -> None:
    """What was fetched must be brought somewhere, and nobody may go off with a thing in hand.

    "Pick up the cup and go to the kitchen" would be reached by two robots: one holds, one goes.
    """
    for i, wish in enumerate(wishes):
        if wish.relation != HELD or _dealt(wish, wishes):
            continue
        brought = [j for j in range(i + 1, len(wishes)) if _brings(wishes[j], wish)]
        if wish.whereto and not brought:
            raise NotUnderstood(
                f"it does not say where to bring {one_of(wish.subjects)}: name a place, "
                'or say "pick up"'
            )
        if not brought and any(later.means for later in wishes[i + 1 :]):
            raise NotUnderstood(
                f"it does not say whether {one_of(wish.subjects)} goes along: "
                'say "bring … to …" to take it somewhere'
            )


def _dealt(held: Wish, wishes: Sequence[Wish]) -> bool:
    """Whether it is taken to be one of those that are put somewhere: "take the apples, and put one
    on each plate"."""
    if held.relation != HELD or held.open:
        return False
    taken = {w.subjects[0] for w in wishes if w.relation == HELD and w.key == held.key}
    return len(taken) > 1 and any(
        w.open and w.relation in PLACED and taken == set(w.subjects) for w in wishes
    )


def _for_speaker(wish: Wish, wishes: Sequence[Wish], speaker: str) -> Wish:
    """The same, or that the speaker has it, where it was fetched and nothing says where to."""
    at = next(i for i, other in enumerate(wishes) if other is wish)
    later = wishes[at + 1 :]
    if not wish.whereto or any(_brings(w, wish) for w in later) or _dealt(wish, wishes):
        return wish
    return replace(wish, relation=AT, value=speaker, on_robot=True, whereto=False)


def _brings(wish: Wish, held: Wish) -> bool:
    return wish.relation in PLACED and _same(wish, held)


def _without_implied_travel(stage: Sequence[Wish]) -> list[Wish]:
    """Without going somewhere with what is in hand and put down there later in the stage."""
    kept = []
    for i, wish in enumerate(stage):
        held = [h for h in stage[:i] if h.relation == HELD]
        if wish.means and any(
            _brings(later, h) and later.value == wish.value
            for later in stage[i + 1 :]
            for h in held
        ):
            continue
        kept.append(wish)
    return kept


def _sequenced(stage: Sequence[Wish]) -> list[list[Wish]]:
    """ "Go to the kitchen and pick up the cup" means one after the other."""
    split: list[list[Wish]] = [[]]
    for wish in stage:
        last = split[-1][-1] if split[-1] else None
        sent = last is not None and last.relation == AT and last.by is None
        if last is not None and sent and wish.by and set(last.subjects) <= set(wish.by):
            split.append([])  # "Rosie, go to the kitchen and fetch …"
        elif last is not None and last.means and not wish.means:
            if wish.relation == SEARCHED and wish.subjects == (last.value,):
                split[-1].pop()
            else:
                split.append([])
        split[-1].append(wish)
    return split


def _consistent(stage: Sequence[Wish], is_at: Callable[[str, str], bool]) -> list[Wish]:
    stage = _finest(stage, is_at)
    kept = [
        wish
        for i, wish in enumerate(stage)
        if not any(_implies(other, wish, later=j > i) for j, other in enumerate(stage) if i != j)
    ]
    kept = [_narrowed(wish, kept) for wish in kept if not _dealt(wish, stage)]
    fixed: dict[tuple[str, str], Wish] = {}
    for wish in kept:
        if not wish.open:
            relation = AT if wish.relation in PLACED else wish.relation
            before = fixed.setdefault((relation, wish.subjects[0]), wish)
            if before.value != wish.value:
                raise NotUnderstood(
                    f"it wants {wish.subjects[0]} in two places: {before.value} and "
                    f"{wish.value}; {_THEN}"
                )
    for wish in kept:
        put_down = [w for w in kept if w.relation in PLACED and not w.on_robot]
        if wish.relation == HELD and any(
            w.key == wish.key or (not w.open and w.subjects == wish.subjects) for w in put_down
        ):
            raise NotUnderstood(f"it wants {one_of(wish.subjects)} both held and put down; {_THEN}")
    _check_open(kept, fixed)
    return kept


def _finest(stage: Sequence[Wish], is_at: Callable[[str, str], bool]) -> list[Wish]:
    """Without those that say less finely what others say: in the kitchen, and on a table there."""
    placed = [wish for wish in stage if wish.relation in PLACED]
    return [
        wish
        for wish in stage
        if wish not in placed
        or not any(
            _same(wish, other)
            and other.value != wish.value
            and is_at(str(other.value), str(wish.value))
            for other in placed
        )
    ]


def _implies(wish: Wish, other: Wish, later: bool) -> bool:
    """Whether `other` need not be said beside `wish`."""
    same = _same(wish, other)
    if other.relation == LOCATED and wish.value in other.subjects:
        return wish.relation in PLACED  # "find Lily and give her the doll"
    if other.relation == LOCATED:
        return same and wish.relation in {*PLACED, HELD}
    return same and other.relation == HELD and wish.relation in PLACED and later


def _narrowed(wish: Wish, others: Sequence[Wish]) -> Wish:
    """An open wish without those that another one names: "the first cup and another cup"."""
    if not wish.open or wish.relation not in PLACED:
        return wish
    named = {w.subjects[0] for w in others if w.relation in PLACED and not w.open}
    left = tuple(s for s in wish.subjects if s not in named)
    if not left:
        raise NotUnderstood(f"it wants more of {one_of(wish.subjects)} than there are; {_THEN}")
    return replace(wish, subjects=left, open=len(left) > 1)


def _check_open(kept: Sequence[Wish], fixed: dict[tuple[str, str], Wish]) -> None:
    """Whether somebody is left for every open wish: each is in one place only.

    Wishes are matched with subjects by augmenting paths (Kuhn 1955).
    """
    at = [wish for wish in kept if wish.open and wish.relation in PLACED and not wish.shared]
    for wish in at:
        for other in at:
            if wish.key == other.key and wish.value != other.value:
                raise NotUnderstood(
                    f"it wants one of {one_of(wish.subjects)} in two places: {wish.value} and "
                    f"{other.value}; {_THEN}"
                )
            same = (wish.subjects, wish.value) == (other.subjects, other.value)
            if wish.key != other.key and same:
                raise NotUnderstood(
                    f"it wants one of {one_of(wish.subjects)} in {wish.value} more than once: "
                    "say how many, or which ones"
                )
    taken = {name: wish for (relation, name), wish in fixed.items() if relation == AT}
    open_wishes = list(dict.fromkeys(replace(wish, key=0) for wish in at))
    open_wishes = [
        w
        for w in open_wishes
        if not any(taken[s].value == w.value for s in w.subjects if s in taken)
    ]
    holder: dict[str, Wish] = {}

    def assign(wish: Wish, tried: set[str]) -> bool:
        for name in wish.subjects:
            if name in taken or name in tried:
                continue
            tried.add(name)
            if name not in holder or assign(holder[name], tried):
                holder[name] = wish
                return True
        return False

    for wish in open_wishes:
        if not assign(wish, set()):
            raise NotUnderstood(f"it wants more of {one_of(wish.subjects)} than there are; {_THEN}")
