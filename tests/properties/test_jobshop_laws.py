"""Laws of the scheduling solver on small random shops, against brute force over all schedules."""

from __future__ import annotations

from itertools import permutations, product

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from benchmarks.allocation.shops import without_machines
from fleet.jobshop.bounds import bound_with_travel, lower_bound
from fleet.jobshop.forward_pass import schedule_of
from fleet.jobshop.portfolio import schedule_in_order, solve
from fleet.jobshop.preprocessing import Instance
from fleet.jobshop.problem import BadShop, Block, Machine, Operation, Position, Schedule, Shop
from fleet.jobshop.rescheduling import WITHIN, reschedule
from fleet.jobshop.search.branch_and_bound import branch_and_bound
from fleet.jobshop.search.cpsat import helps, installed, request_of
from fleet.jobshop.search.cpsat_process import Model
from fleet.jobshop.search.list_scheduling import list_schedule
from fleet.jobshop.search.warm_start import warm_start
from fleet.jobshop.sequencing import sequences
from fleet.jobshop.time_budget import TimeBudget
from tests.support.reached import Reached, reaches
from tests.support.searches import NEVER_S, steps

NEAR = 1e-6
TWO_THAT_MUST_BE_FIRST = Shop(
    (Operation((0,), (1.0,)), Operation((1, 0), (1.0,)), Operation((2,), (1.0,))),
    (Block((0, 1), (1,)), Block((1,), (0,), Position.FIRST), Block((2,), (0,), Position.FIRST)),
    (Machine(), Machine(), Machine()),
)
SHORTEST_IN_ANOTHER_ORDER = Shop(
    (
        Operation((0,), (1.0,)),
        Operation((0,), (1.0,), after=(3,)),
        Operation((1,), (1.0,), after=(0,)),
        Operation((2,), (5.0,)),
        Operation((3,), (10.0,), after=(2,)),
    ),
    (Block((0, 1), (0,)), Block((2,), (1,)), Block((3,), (1,)), Block((4,), (2,))),
    (Machine(), Machine(), Machine()),
)
"""Machine 1 takes block 1 first, which waits for the beginning of block 0, whose end waits for
block 2: no order of whole blocks."""
SITES = 3


@st.composite
def shops(
    draw: st.DrawFn,
    most_blocks: int = 4,
    most_machines: int | None = None,
    always_travels: bool = False,
) -> Shop:
    """Chains, meetings, travel, kinds, machines that are late, blocks to be first or last."""
    kinds = draw(st.integers(1, 2))
    machines = tuple(
        Machine(
            draw(st.integers(0, kinds - 1)),
            draw(st.integers(0, SITES - 1)),
            draw(st.sampled_from([0.0, 0.0, 3.0])),
        )
        for _ in range(draw(st.integers(1, 3)))
    )
    travel = always_travels or draw(st.booleans())
    seconds = st.integers(1, 9).map(float)
    numbers = st.sampled_from(range(len(machines)))
    members: list[list[int]] = []
    able: list[tuple[int, ...]] = []
    operations: list[Operation] = []
    for block in range(draw(st.integers(1, most_blocks))):
        members.append([])
        able.append(tuple(sorted(draw(st.sets(numbers, min_size=1, max_size=most_machines)))))
        for _ in range(draw(st.integers(1, 2))):
            here = len(operations)
            meets = block > 0 and draw(st.integers(0, 4)) == 0
            with_ = (block, draw(st.integers(0, block - 1))) if meets else (block,)
            after = draw(st.sets(st.sampled_from(range(here)), max_size=1)) if here else set()
            sites = (*range(SITES),) if always_travels else (None, *range(SITES))
            site = draw(st.sampled_from(sites)) if travel else None
            operations.append(
                Operation(
                    with_,
                    tuple(draw(seconds) for _ in range(kinds)),
                    tuple(after),
                    target=site,
                    arrives=site if always_travels or draw(st.booleans()) else None,
                    weight=1.0,
                )
            )
            for one in with_:
                members[one].append(here)
    places = st.sampled_from([Position.ANYWHERE] * 5 + [Position.FIRST, Position.LAST])
    blocks = tuple(
        Block(tuple(ops), rows, draw(places)) for ops, rows in zip(members, able, strict=True)
    )
    ways = tuple(
        tuple(tuple(float(abs(a - b) * (2 + kind)) for b in range(SITES)) for a in range(SITES))
        for kind in range(kinds)
    )
    return Shop(tuple(operations), blocks, machines, ways)


def wrong(shop: Shop, found: Schedule) -> str | None:
    """What is not right about a schedule, told without the code that made it."""
    for number, block in enumerate(shop.blocks):
        if found.machine_of[number] not in block.machines:
            return f"block {number} is on a machine that cannot do it"
        if any(found.machine_of[o] == found.machine_of[number] for o in block.apart):
            return f"block {number} is not apart"
        for one, other in zip(block.operations, block.operations[1:], strict=False):
            if found.start_s[other] < found.end_s[one] - NEAR:
                return f"operations {one}, {other} of a block overlap"
    for number, operation in enumerate(shop.operations):
        if any(found.start_s[number] < found.end_s[b] - NEAR for b in operation.after):
            return f"operation {number} starts too early"
    for machine, row in enumerate(shop.machines):
        mine = [b for b in found.order if found.machine_of[b] == machine]
        free_s, site, place = row.ready_s, row.site, Position.FIRST
        for block in mine:
            operations = shop.blocks[block].operations
            if place == Position.LAST or shop.blocks[block].position < place:
                return f"block {block} stands in the wrong place"
            place = shop.blocks[block].position
            if found.start_s[operations[0]] < free_s - NEAR:
                return f"machine {machine} is in two places"
            for number in operations:
                operation = shop.operations[number]
                if operation.blocks[0] != block:
                    continue
                lasts = operation.duration_s[row.kind]
                if operation.target is not None:
                    lasts += shop.travel_s[row.kind][site][operation.target]
                if abs(found.end_s[number] - found.start_s[number] - lasts) > NEAR:
                    return f"operation {number} does not take what it takes"
                site = site if operation.arrives is None else operation.arrives
            free_s = found.end_s[operations[-1]]
    return None


def every_schedule(shop: Shop) -> list[Schedule]:
    """All that are right, machine by machine and order by order."""
    tried = (
        schedule_of(shop, order, machine_of)
        for machine_of in product(*(block.machines for block in shop.blocks))
        for order in permutations(range(len(shop.blocks)))
    )
    return [found for found in tried if found is not None and wrong(shop, found) is None]


def sound(shop: Shop) -> bool:
    """Whether operations do not wait for each other in a circle."""
    try:
        Instance(shop)
    except BadShop:
        return False
    return True


@reaches(
    "none found",
    "optimal by another bound",
    "better than the list schedule",
    "meeting",
    "with travel",
)
@settings(max_examples=150, deadline=None)
@given(shops())
def test_schedules_are_right_and_bounds_hold(reached: Reached, shop: Shop) -> None:
    assume(sound(shop))
    instance = Instance(shop)
    found = solve(shop, steps(0.02), exact=False)
    if found is None:
        reached["none found"] += 1
        return
    assert wrong(shop, found) is None
    least_s = min(one.makespan_s for one in every_schedule(shop))
    assert lower_bound(instance) <= least_s + NEAR
    assert bound_with_travel(instance) <= least_s + NEAR
    assert found.lower_bound_s <= least_s + NEAR
    assert least_s <= found.makespan_s + NEAR
    listed = list_schedule(instance)
    assert listed is None or found.makespan_s <= listed.makespan_s + NEAR
    reached["optimal by another bound"] += lower_bound(instance) < least_s - NEAR
    reached["better than the list schedule"] += (
        listed is not None and found.makespan_s < listed.makespan_s - NEAR
    )
    reached["meeting"] += bool(instance.several)
    reached["with travel"] += instance.travels


@reaches("several blocks")
@settings(max_examples=100, deadline=None)
@given(shops())
def test_where_blocks_are_free_and_alone_there_is_always_an_answer(
    reached: Reached, shop: Shop
) -> None:
    assume(sound(shop) and all(len(o.blocks) == 1 for o in shop.operations))
    assume(all(block.position == Position.ANYWHERE for block in shop.blocks))
    assume(not Instance(shop).several)
    assert solve(shop, steps(0.0), exact=False) is not None
    reached["several blocks"] += len(shop.blocks) > 2


@reaches("shorter", "proven", "not proven")
@settings(max_examples=150, deadline=None)
@example(SHORTEST_IN_ANOTHER_ORDER)
@given(shops())
def test_what_looked_at_every_schedule_is_as_short_as_brute_force(
    reached: Reached, shop: Shop
) -> None:
    assume(sound(shop))
    instance = Instance(shop)
    begin = list_schedule(instance)
    assume(begin is not None)
    assert begin is not None
    found = branch_and_bound(instance, begin)
    assert found is not None, "four blocks are not too many"
    made = schedule_in_order(instance, found.solution)
    assert wrong(shop, made) is None
    assert made.makespan_s <= begin.makespan_s + NEAR
    reached["shorter"] += made.makespan_s < begin.makespan_s - NEAR
    reached["proven" if found.proven else "not proven"] += 1
    if found.proven:
        least_s = min(one.makespan_s for one in every_schedule(shop))
        assert abs(made.makespan_s - least_s) <= NEAR


@reaches("several", "one", "none")
@settings(max_examples=100, deadline=None)
@given(shops(most_machines=1))
def test_orders_of_settled_blocks_are_right_and_the_first_is_the_best(
    reached: Reached, shop: Shop
) -> None:
    assume(sound(shop))
    machine_of = tuple(block.machines[0] for block in shop.blocks)
    alone = all(len(operations) == 1 for operations in Instance(shop).operations_of)
    alone = alone and not Instance(shop).several
    least_s = min((one.makespan_s for one in every_schedule(shop)), default=None)
    by_machine = set()
    for number, order in enumerate(sequences(shop, steps(0.05))):
        made = schedule_of(shop, order, machine_of)
        assert made is not None and wrong(shop, made) is None
        assert least_s is not None
        assert number > 0 or not alone or made.makespan_s <= least_s + NEAR
        mine = frozenset(tuple(b for b in order if machine_of[b] == m) for m in set(machine_of))
        assert mine not in by_machine, "the same order twice"
        by_machine.add(mine)
    assert by_machine or not alone or least_s is None
    reached["several" if len(by_machine) > 1 else "one" if by_machine else "none"] += 1


@reaches("proven")
@settings(max_examples=12, deadline=None)
@given(shops(most_blocks=3))
def test_cp_sat_agrees_with_brute_force(reached: Reached, shop: Shop) -> None:
    assume(sound(shop) and solve(shop, steps(0.0), exact=False) is not None)
    found = solve(shop, TimeBudget(NEVER_S) if helps(Instance(shop)) else steps(0.05))
    assert found is not None
    assert wrong(shop, found) is None
    least_s = min(one.makespan_s for one in every_schedule(shop))
    assert found.lower_bound_s <= least_s + NEAR
    if found.gap < NEAR:
        assert found.makespan_s <= least_s + NEAR
        reached["proven"] += 1


@pytest.mark.skipif(not installed(), reason="OR-Tools is an extra: cp-sat")
@reaches("with travel", "without travel")
@settings(max_examples=100, deadline=None)
@example(TWO_THAT_MUST_BE_FIRST)
@given(shops(most_blocks=3) | shops(most_blocks=3, always_travels=True))
def test_the_model_of_cp_sat_has_the_optimum_of_brute_force(reached: Reached, shop: Shop) -> None:
    """The whole of it, cuts included, solved to the end; times are whole seconds."""
    from ortools.sat.python import cp_model

    assume(sound(shop))
    instance = Instance(shop)
    hint = list_schedule(instance)
    if hint is None or not helps(instance):
        return
    data = request_of(instance, hint, lower_bound(instance), until_s=0.0, seed=0)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    assert solver.solve(Model(cp_model, data).model) == cp_model.OPTIMAL
    least_s = min(one.makespan_s for one in every_schedule(shop))
    assert solver.objective_value <= least_s + NEAR
    if all(o.target is None or o.arrives is not None for o in shop.operations):
        # Who drives somewhere and is not there afterwards has only his first way in the model.
        assert solver.objective_value == pytest.approx(least_s)
        reached["with travel" if instance.travels else "without travel"] += 1


@reaches("could move")
@settings(max_examples=150, deadline=None)
@given(shops())
def test_who_can_stay_stays(reached: Reached, shop: Shop) -> None:
    """With no machine gone and the old makespan as the target nobody moves, and nothing is late."""
    assume(sound(shop))
    instance = Instance(shop)
    listed = list_schedule(instance)
    assume(listed is not None)
    assert listed is not None
    again = warm_start(instance, listed.order, listed.machine_of, listed.makespan_s)
    assert again is not None
    assert again.machine_of == listed.machine_of
    assert again.makespan_s <= listed.makespan_s + NEAR
    reached["could move"] += any(len(block.machines) > 1 for block in shop.blocks)


@reaches("orphans", "some stayed")
@settings(max_examples=60, deadline=None)
@given(shops(), st.data())
def test_a_repaired_schedule_is_right_and_moves_little(
    reached: Reached, shop: Shop, data: st.DataObject
) -> None:
    assume(sound(shop) and len(shop.machines) > 1)
    planned = solve(shop, steps(0.0), exact=False)
    assume(planned is not None)
    assert planned is not None
    lost = data.draw(st.sampled_from(range(len(shop.machines))))
    try:
        left = without_machines(shop, frozenset({lost}))
    except BadShop:
        return
    found = reschedule(left, planned.machine_of, planned.order, steps(0.03))
    if found is None:
        return
    assert wrong(left, found.schedule) is None
    orphans = {b for b, machine in enumerate(planned.machine_of) if machine == lost}
    assert orphans <= set(found.moved)
    assert found.schedule.makespan_s <= found.best_makespan_s * (1 + WITHIN) + NEAR
    assert found.schedule.lower_bound_s <= found.schedule.makespan_s + NEAR
    assert set(found.moved) == {
        b for b, m in enumerate(found.schedule.machine_of) if m != planned.machine_of[b]
    }
    reached["orphans"] += bool(orphans)
    reached["some stayed"] += len(found.moved) < len(shop.blocks)
