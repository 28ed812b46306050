"""Which goals can be wanted again, or sooner."""

from __future__ import annotations

import pytest

from cli.client.goal_changes import check_failed, check_open
from cli.errors import Refused
from keyexpr_schema.payloads.goals import GoalState, GoalStatus


@pytest.mark.parametrize(
    ("state", "instead"),
    [
        (GoalState.RUNNING, "it has not failed"),
        (GoalState.WAITING, "have it planned with `robotctl plan create`"),
        (GoalState.REACHED, "say it once more with `robotctl goal add`"),
        (GoalState.REJECTED, "say it in other words with `robotctl goal add`"),
    ],
)
def test_only_what_has_failed_is_wanted_again(state: GoalState, instead: str) -> None:
    known = {
        "g": GoalStatus(goal="g", state=GoalState.FAILED),
        "h": GoalStatus(goal="h", state=state),
    }
    check_failed(["g"], known)
    with pytest.raises(Refused, match=f"goal h is {state.value}, it has not failed") as error:
        check_failed(["g", "h"], known)
    assert instead in str(error.value)


def test_what_has_ended_does_not_become_more_urgent() -> None:
    failed = {"g": GoalStatus(goal="g", state=GoalState.FAILED)}
    check_open(["unread"], failed)
    with pytest.raises(Refused, match="goal g is failed: nothing of it is left to be done"):
        check_open(["unread", "g"], failed)
