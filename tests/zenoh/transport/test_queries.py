"""Queries are served, refused or without a reply, each with a sentence."""

from __future__ import annotations

import asyncio

import pytest

from keyexpr_schema.errors import NoReply
from keyexpr_schema.keyspace import SIM_MOTION
from keyexpr_schema.payloads.motions import MotionOutcome, MotionState
from keyexpr_schema.payloads.simulation import MotionCall, SimRobotAddress
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S
from tests.support.session_values import motion_call, senses


async def _ask_whoever_comes(client, address, call="c1"):
    """Ask until the other session's declaration has come through the router."""
    async with asyncio.timeout(DEADLINE_S):
        while True:
            try:
                return await client.query(SIM_MOTION, address, motion_call(call))
            except NoReply as error:
                if "nobody serves" not in str(error):
                    raise


async def test_questions_are_served_several_at_a_time(session_config):
    all_in = asyncio.Barrier(5)

    async def handler(address: SimRobotAddress, call: MotionCall) -> MotionOutcome:
        await all_in.wait()
        return MotionOutcome(
            state=MotionState.SUCCEEDED, senses=senses(1.0), reason=f"{address.robot} {call.call}"
        )

    async with (
        open_session(session_config()) as server,
        open_session(session_config()) as client,
        server.serve(SIM_MOTION, handler),
    ):
        answers = await asyncio.gather(
            *(_ask_whoever_comes(client, SimRobotAddress("r1"), f"c{n}") for n in range(5))
        )
        assert sorted(answer.reason for answer in answers) == [f"r1 c{n}" for n in range(5)]


async def test_a_failing_slow_or_absent_server_is_no_answer_with_a_sentence(session_config):
    async def handler(address: SimRobotAddress, call: MotionCall) -> MotionOutcome:
        if call.call == "slow":
            await asyncio.Event().wait()
        raise ValueError("the arm is stuck")

    r1 = SimRobotAddress("r1")
    async with (
        open_session(session_config(component="sim")) as server,
        open_session(session_config()) as client,
    ):
        with pytest.raises(NoReply, match="nobody serves sim/robots/r1/motion"):
            await client.query(SIM_MOTION, r1, motion_call("c1"))
        async with server.serve(SIM_MOTION, handler, robot="r1"):
            with pytest.raises(NoReply, match="sim failed: the arm is stuck"):
                await _ask_whoever_comes(client, r1)
            with pytest.raises(NoReply, match="nobody serves sim/robots/r2/motion"):
                await client.query(SIM_MOTION, SimRobotAddress("r2"), motion_call("c1"))
            with pytest.raises(NoReply, match=r"did not answer within 0\.3 s"):
                await client.query(SIM_MOTION, r1, motion_call("slow"), 0.3)
            waiting = asyncio.create_task(
                client.query(SIM_MOTION, r1, motion_call("slow"), DEADLINE_S)
            )
            done, _ = await asyncio.wait({waiting}, timeout=0.2)
            assert not done
        with pytest.raises(NoReply, match="sim is going away"):
            await asyncio.wait_for(waiting, DEADLINE_S)
