"""A schedule gone through again, for a target: who can stay where he is does, and whoever cannot
goes where he is in nobody's way.

For every block it is known what follows it in the old schedule, on its machine and by dependency,
at the least (its tail). A block that ends at home early enough for its tail stays. Another one, or
one whose machine is gone, goes where the latest of what then comes out is earliest: its own tail,
and that of the block that is next there (insertion as in Werner and Winkler 1995).
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet.jobshop.compiled import Compiled
from fleet.jobshop.list_scheduling import Answer, Board, Guess
from fleet.jobshop.timing import rate

NEAR = 1e-9


def keep(
    shop: Compiled, knots: Sequence[int], home: Sequence[int], target_s: float
) -> Answer | None:
    """The schedule in the order `knots`, with few blocks away from `home`; it may miss the target.

    `None` if some block finds no machine.
    """
    board = _Keeping(shop, knots, home, target_s)
    if any(board.place(knot) is None for knot in knots):
        return None
    rated = rate(shop, knots, board.machine_of)
    return None if rated is None else Answer(list(knots), board.machine_of, rated)


class _Keeping(Board):
    def __init__(
        self, shop: Compiled, knots: Sequence[int], home: Sequence[int], target_s: float
    ) -> None:
        super().__init__(shop)
        self.home, self.target_s = home, target_s
        self.queue: list[list[int]] = [[] for _ in shop.shop.machines]
        """By machine, its blocks that are not placed yet, the next one last."""
        for knot in reversed(knots):
            for block in reversed(shop.knot_blocks[knot]):
                if home[block] in self.eligible[block]:
                    self.queue[home[block]].append(block)
        self.tail_s = _tails_s(shop, knots, home, self.queue)

    def best(self, block: int) -> Guess | None:
        """Home, if that will do for the target; else where least is delayed."""
        shop = self.shop
        place = shop.places[block]
        others = {self.machine_of[other] for other in shop.shop.blocks[block].apart}
        others |= {self.machine_of[other] for other in shop.not_ahead[block]}
        ready_s = self.ready_s(block)
        home = self.home[block]
        stays = home in self.eligible[block]
        if stays and self.queue[home] and self.queue[home][-1] == block:
            self.queue[home].pop()
        elif stays:
            self.queue[home].remove(block)
        if stays and home not in others and self._open(home, place):
            found = self.guess(block, home, ready_s)
            if found.finish_s + self.tail_s[block] <= self.target_s * (1 + NEAR):
                return found
        own_s = shop.tails[shop.steps_of[block][-1]]
        best: tuple[float, float] | None = None
        chosen: Guess | None = None
        for machine in shop.shop.blocks[block].machines:
            if machine in others or not self._open(machine, place):
                continue
            found = self.guess(block, machine, ready_s)
            latest_s = found.finish_s + own_s
            if self.queue[machine]:
                follows = self.queue[machine][-1]
                rest_s = _way_s(shop, block, follows, machine) + _length_s(shop, follows, machine)
                latest_s = max(latest_s, found.finish_s + rest_s + self.tail_s[follows])
            score = (latest_s, found.finish_s)
            if best is None or score < best:
                best, chosen = score, found
        return chosen


def _tails_s(
    shop: Compiled, knots: Sequence[int], home: Sequence[int], queue: Sequence[Sequence[int]]
) -> list[float]:
    """By block: how long the old schedule goes on after its last step, at the least, s."""
    next_of: dict[int, int] = {}
    for blocks in queue:
        next_of.update(zip(blocks[1:], blocks, strict=False))
    step_tail_s = [0.0] * len(shop.befores)
    step_rest_s = [0.0] * len(shop.befores)
    """With the step itself."""
    tails_s = [0.0] * len(home)
    for knot in reversed(knots):
        for step in reversed(shop.flow[knot]):
            tail_s = max((step_rest_s[later] for later in shop.laters[step.number]), default=0.0)
            for block in step.closes:
                if block in next_of:
                    after = next_of[block]
                    first = shop.steps_of[after][0]
                    way_s = _way_s(shop, block, after, home[block])
                    tail_s = max(tail_s, way_s + step_rest_s[first])
            step_tail_s[step.number] = tail_s
            machine = home[step.block]
            lasts_s = (
                step.duration_s[shop.kinds[machine]]
                if machine in shop.shop.blocks[step.block].machines
                else shop.least[step.number]
            )
            step_rest_s[step.number] = lasts_s + tail_s
            for block in step.closes:
                tails_s[block] = tail_s
    return tails_s


def _way_s(shop: Compiled, block: int, after: int, machine: int) -> float:
    """The way from where a block leaves the machine to where the next begins, as far as known."""
    site, target = shop.exit_of[block], shop.entry[after]
    return shop.shop.travel_s[shop.kinds[machine]][site][target] if min(site, target) >= 0 else 0.0


def _length_s(shop: Compiled, block: int, machine: int) -> float:
    own = shop.own_s[block]
    return own[shop.kinds[machine]] if own else 0.0
