"""Wishes made to fit: without what others imply, and free of contradictions."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.wish import PLACED, THEN, Wish
from keyexpr_schema.facts import AT, HELD, IN, LOCATED, ON, SEARCHED


def _same(one: Wish, other: Wish) -> bool:
    if one.open or other.open:
        return one.key == other.key or (one.subjects, one.open) == (other.subjects, other.open)
    return one.subjects == other.subjects


def check_carried(wishes: Sequence[Wish]) -> None:
    """What was fetched must be brought somewhere, and nobody may go off with a thing in hand.

    "Pick up the cup and go to the kitchen" would be reached by two robots: one holds, one goes.
    """
    dealt = _dealt(wishes)
    for i, wish in enumerate(wishes):
        if wish.relation != HELD or wish.key in dealt:
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


def _dealt(wishes: Sequence[Wish]) -> set[int]:
    """The keys of what is taken to be put somewhere one by one: "take the apples, and put one on
    each plate"."""
    taken: dict[int, set[str]] = defaultdict(set)
    for wish in wishes:
        if wish.relation == HELD and not wish.open:
            taken[wish.key].add(wish.subjects[0])
    if not taken:
        return set()
    put = {frozenset(w.subjects) for w in wishes if w.open and w.relation in PLACED}
    return {key for key, names in taken.items() if len(names) > 1 and frozenset(names) in put}


def without_means(stages: Sequence[Sequence[Wish]]) -> list[list[Wish]]:
    """Without taking what something is done to then: "get the bin and empty it" """
    last: dict[object, int] = {}
    wishes = [wish for stage in stages for wish in stage]
    for number, wish in enumerate(wishes):
        if wish.relation not in (*PLACED, HELD, LOCATED, SEARCHED):
            last[wish.subjects, wish.open] = number
            if wish.open:
                last[wish.key] = number

    def done_to(wish: Wish) -> int:
        by_key = last.get(wish.key, -1) if wish.open else -1
        return max(last.get((wish.subjects, wish.open), -1), by_key)

    put: dict[object, int] = {}
    for number, wish in enumerate(wishes):
        if wish.relation in PLACED:
            put[wish.subjects] = number
            if wish.open:
                put[wish.key] = number

    def is_over(wish: Wish, number: int) -> bool:
        moved = wish.for_now and max(put[wish.subjects], put.get(wish.key, 0)) > number
        return moved or (wish.relation == HELD and done_to(wish) > number)

    numbers = count()
    return [[w for w in stage if not is_over(w, next(numbers))] for stage in stages]


def for_speaker(wish: Wish, wishes: Sequence[Wish], speaker: str) -> Wish:
    """The same, or that the speaker has it, where it was fetched and nothing says where to."""
    if not wish.whereto:
        return wish
    at = next(i for i, other in enumerate(wishes) if other is wish)
    later = wishes[at + 1 :]
    if any(_brings(w, wish) for w in later) or wish.key in _dealt(wishes):
        return wish
    return replace(wish, relation=AT, value=speaker, on_robot=True, whereto=False)


def _brings(wish: Wish, held: Wish) -> bool:
    return wish.relation in PLACED and _same(wish, held)


def without_implied_travel(stage: Sequence[Wish]) -> list[Wish]:
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


def sequenced(stage: Sequence[Wish]) -> list[list[Wish]]:
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


def consistent(stage: Sequence[Wish], is_at: Callable[[str, str], bool]) -> list[Wish]:
    """The wishes of one stage without those that others imply.

    Raises:
        NotUnderstood: two of them cannot both come true.
    """
    stage = _finest(_without_riders(stage), is_at)
    kept = [
        wish
        for i, wish in enumerate(stage)
        if not any(_implies(other, wish, later=j > i) for j, other in enumerate(stage) if i != j)
    ]
    dealt = _dealt(stage)
    kept = [_narrowed(w, kept) for w in kept if w.relation != HELD or w.key not in dealt]
    fixed: dict[tuple[str, str], Wish] = {}
    for wish in kept:
        if not wish.open:
            relation = AT if wish.relation in PLACED else wish.relation
            before = fixed.setdefault((relation, wish.subjects[0]), wish)
            if before.value != wish.value:
                raise NotUnderstood(
                    f"it wants {wish.subjects[0]} in two places: {before.value} and "
                    f"{wish.value}; {THEN}"
                )
    for wish in kept:
        put_down = [w for w in kept if w.relation in PLACED and not w.on_robot]
        if wish.relation == HELD and any(
            w.key == wish.key or (not w.open and w.subjects == wish.subjects) for w in put_down
        ):
            raise NotUnderstood(f"it wants {one_of(wish.subjects)} both held and put down; {THEN}")
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


def _without_riders(stage: Sequence[Wish]) -> list[Wish]:
    """Without what is put on or in something that shall be there: "put it in the box, and bring
    both to the garage"."""
    aboard = {(w.subjects, w.value) for w in stage if w.relation in (ON, IN)}
    if not aboard:
        return list(stage)
    moved = {(w.subjects[0], w.value) for w in stage if w.relation == AT and not w.open}
    riding = {(names, where) for names, on in aboard for name, where in moved if name == on}
    return [w for w in stage if w.relation != AT or (w.subjects, w.value) not in riding]


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
        raise NotUnderstood(f"it wants more of {one_of(wish.subjects)} than there are; {THEN}")
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
                    f"{other.value}; {THEN}"
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
            raise NotUnderstood(f"it wants more of {one_of(wish.subjects)} than there are; {THEN}")
