"""What a revision says of itself: how many tasks it kept, dropped and added."""

from __future__ import annotations

from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator


def test_a_waiting_task_that_is_so_already_counts_once() -> None:
    """It was counted as kept and as needless, and taken off the tasks added twice.

    The model checks every revision's counts against the records.
    """
    model = FleetModel((manipulator(), carrier()), 3)
    model.plan(bring(1, "living_room"), bring(2, "hallway"), bring(3, "hallway"))

    def order(number: int):  # type: ignore[no-untyped-def]
        return model.orders()[number % len(model.orders())]

    model.start(order(3))
    model.start(order(2))
    model.fail(order(3))
    model.interrupt(order(0), done=True)
    model.interrupt(order(0), done=False)
    model.fail(order(7))
    (entry,) = model.state.plans.values()
    assert entry.plan.revision == 3
    model.finish()
