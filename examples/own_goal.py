"""Give the fleet a goal from a program of your own, and follow what becomes of it.

    python examples/own_goal.py "Bring the first cup to the hallway." [tcp/127.0.0.1:7447 [plan]]

A goal is one key that you put, its status one key that the planner puts: nothing else is needed to
talk to the fleet. With `plan` as third word the planner is also asked for a plan, which it then
carries out; one that plans unasked (`--auto-plan`) has begun with that, perhaps, and says so. It
ends when the goal has, or when nobody works on it.
"""

from __future__ import annotations

import asyncio
import sys
import uuid

from keyexpr_schema import (
    ANSWER,
    ENDED_GOALS,
    GOAL_SPEC,
    GOAL_STATUS,
    PLAN_REQUEST,
    Goal,
    GoalAddress,
    GoalState,
    GoalStatus,
    PlanRequest,
    RequestAddress,
    SchemaError,
    SessionConfig,
    WaitKind,
    open_session,
    slug,
)

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"


async def want(text: str, router: str = DEFAULT_ROUTER, plan: bool = False) -> GoalState:
    """Store the goal `text`; return how it ended, or, with no plan, how it was understood. A goal
    for which a plan is wanted and none is made is still waiting.

    Raises:
        SchemaError: no router answers, or the sentence has no words to name the goal after.
    """
    config = SessionConfig(endpoints=(router,), component="own-goal")
    goal = Goal(goal=slug(text), text=text)
    async with open_session(config) as session:
        # `confirm` returns when the store has it: a bare put is lost while a router restarts.
        await session.confirm(GOAL_SPEC, GoalAddress(goal.goal), goal)
        request = PlanRequest(request=f"req-{uuid.uuid4().hex[:12]}", goals=(goal.goal,))
        if plan:
            await session.confirm(PLAN_REQUEST, RequestAddress(request.request), request)
        # A watch first gives what is stored already, so it does not matter who was faster.
        news = (GOAL_STATUS, {"goal": goal.goal}), (ANSWER, {"request": request.request})
        status, answered = None, not plan
        async with session.watch(*news) as watch:
            async for change in watch:
                if change.value is None:
                    continue
                if change.key is ANSWER:
                    answered = True
                    print(f"the planner: {change.value.sentence}", flush=True)  # noqa: T201
                elif change.value != status:
                    status = change.value
                    means = " and ".join(str(condition) for condition in status.conditions)
                    print(f"{status.state.value}: {status.reason or means}", flush=True)  # noqa: T201
                if status is None:
                    continue
                ended = status.state in ENDED_GOALS or not plan
                if ended or (answered and waits_unplanned(status)):
                    return GoalState(status.state)
    raise AssertionError("a watch ends only with its block")


def waits_unplanned(status: GoalStatus) -> bool:
    """Whether a goal waits, and no plan is being made for it."""
    in_plan = any(why.kind is WaitKind.PLAN for why in status.waits_for)
    return status.state is GoalState.WAITING and not in_plan


def main() -> None:
    """Read the command line, run, and exit with 1 if the goal was rejected, failed, or should have
    a plan and has none."""
    words = sys.argv[1:]
    if not 1 <= len(words) <= 3:
        sys.exit(__doc__)
    router = words[1] if len(words) > 1 else DEFAULT_ROUTER
    try:
        plan = words[2:] == ["plan"]
        state = asyncio.run(want(words[0], router, plan))
    except SchemaError as error:
        sys.exit(f"Error: {error}")
    bad = state in (GoalState.REJECTED, GoalState.FAILED) or (plan and state is GoalState.WAITING)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
