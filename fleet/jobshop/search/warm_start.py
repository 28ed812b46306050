"""A schedule gone through again, for a target: blocks stay on their machines where they can, and
the others go where they delay the least.

For every block it is known what follows it in the old schedule, on its machine and by dependency,
at the least (its tail). A block that ends at home early enough for its tail stays. Another one, or
one whose machine is gone, goes where the latest of what then comes out is earliest: its own tail,
and that of the block that is next there (insertion as in Werner and Winkler 1995).
"""

from __future__ import annotations

from collections.abc import Sequence

from fleet.jobshop.forward_pass import Solution
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.search.list_scheduling import GreedySchedule, Placement

NEAR = 1e-9


def warm_start(
    instance: Instance, order: Sequence[int], home: Sequence[int], target_s: float
) -> Solution | None:
    """The schedule in this `order` of components, with few blocks away from `home`; it may miss the
    target.

    `None` if some block finds no machine.
    """
    partial = _NearHome(instance, order, home, target_s)
    if not all(map(partial.add, order)):
        return None
    return partial.solution(list(order))


class _NearHome(GreedySchedule):
    def __init__(
        self, instance: Instance, order: Sequence[int], home: Sequence[int], target_s: float
    ) -> None:
        super().__init__(instance)
        self.home, self.target_s = home, target_s
        self.queue: list[list[int]] = [[] for _ in instance.shop.machines]
        """By machine, its blocks that are not placed yet, the next one last."""
        for component in reversed(order):
            for block in reversed(instance.component_blocks[component]):
                if home[block] in self.eligible[block]:
                    self.queue[home[block]].append(block)
        self.tail_s = _tails_s(instance, order, home, self.queue)

    def best(self, block: int) -> Placement | None:
        """Home, if that will do for the target; else where least is delayed."""
        instance = self.instance
        ready_s = self.ready_s(block)
        home = self.home[block]
        if home in self.eligible[block]:
            self.queue[home].remove(block)
        machines = self.allowed(block)
        if home in machines:
            found = self.placement(block, home, ready_s)
            if found.finish_s + self.tail_s[block] <= self.target_s * (1 + NEAR):
                return found
        own_tail_s = instance.tails_s[instance.operations_of[block][-1]]
        best: tuple[float, float] | None = None
        chosen: Placement | None = None
        for machine in machines:
            found = self.placement(block, machine, ready_s)
            latest_s = found.finish_s + own_tail_s
            if self.queue[machine]:
                follows = self.queue[machine][-1]
                rest_s = _travel_s(instance, block, follows, machine)
                rest_s += instance.length_s(follows, machine)
                latest_s = max(latest_s, found.finish_s + rest_s + self.tail_s[follows])
            score = (latest_s, found.finish_s)
            if best is None or score < best:
                best, chosen = score, found
        return chosen


def _tails_s(
    instance: Instance, order: Sequence[int], home: Sequence[int], queue: Sequence[Sequence[int]]
) -> list[float]:
    """By block: how long the old schedule goes on after its last operation, at the least, s."""
    next_of: dict[int, int] = {}
    for blocks in queue:
        next_of.update(zip(blocks[1:], blocks, strict=False))
    rest_s = [0.0] * len(instance.predecessors)
    """By operation, with itself."""
    tails_s = [0.0] * len(home)
    for component in reversed(order):
        for op in reversed(instance.component_operations[component]):
            after = instance.successors[op.number]
            tail_s = max((rest_s[later] for later in after), default=0.0)
            for block in op.closes:
                if block in next_of:
                    follows = next_of[block]
                    way_s = _travel_s(instance, block, follows, home[block])
                    tail_s = max(tail_s, way_s + rest_s[instance.operations_of[follows][0]])
            machine = home[op.block]
            lasts_s = (
                op.duration_s[instance.kinds[machine]]
                if machine in instance.shop.blocks[op.block].machines
                else instance.least_s[op.number]
            )
            rest_s[op.number] = lasts_s + tail_s
            for block in op.closes:
                tails_s[block] = tail_s
    return tails_s


def _travel_s(instance: Instance, block: int, after: int, machine: int) -> float:
    """From where a block leaves the machine to where the next begins, as far as known, s."""
    site, target = instance.exit_of[block], instance.entry[after]
    if min(site, target) < 0:
        return 0.0
    return instance.shop.travel_s[instance.kinds[machine]][site][target]
