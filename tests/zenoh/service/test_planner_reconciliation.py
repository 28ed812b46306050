"""A store that comes back as an older one gets from a running planner what it lacks."""

from __future__ import annotations

import shutil
from pathlib import Path

from keyexpr_schema.keyspace import ORDER, PLAN_SPEC, PLAN_STATUS, TASK_RECORD
from keyexpr_schema.payloads.plans import PlanAddress
from keyexpr_schema.payloads.tasks import TaskAddress
from tests.support.planner_process import finish, have_planned, person, planner, want
from tests.support.polling import until
from tests.support.router_process import RouterProcess


async def test_a_store_that_is_set_back_gets_what_it_lacks(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path / "planner"):
        await want(session, "Bring cup 1 to the hallway")
        earlier = tmp_path / "earlier"
        with router.frozen():
            shutil.copytree(router.data_dir, earlier)
        await have_planned(session)
        (order,) = (await until(lambda: session.list(ORDER), "an order")).values()
        plan = await session.get(PLAN_SPEC, PlanAddress("p"))
        assert plan is not None
        tasks = {TaskAddress("p", task.task) for task in plan.tasks}

        async def recorded() -> bool:
            return (await session.list(TASK_RECORD)).keys() == tasks

        await until(recorded, "a record of each task")
        router.kill()
        shutil.rmtree(router.data_dir)
        shutil.copytree(earlier, router.data_dir)
        router.start()
        await session.wait_connected()

        async def all_there() -> bool:
            return (
                await session.get(PLAN_STATUS, PlanAddress("p")) is not None
                and list((await session.list(ORDER)).values()) == [order]
                and await recorded()
            )

        await until(all_there, "the planner to write what the store lacks")
        await finish(session, set())
