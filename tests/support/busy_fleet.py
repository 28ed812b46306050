"""A fleet of twenty robots with thirty goals, as robotctl sees it on a bad day."""

from __future__ import annotations

from cli.client.fleet_view import FleetView
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import PlanState, PlanStatus
from keyexpr_schema.payloads.robots import RobotActivity, RobotSpec, RobotState
from keyexpr_schema.payloads.stops import Stop
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason

NOW_S = 1_795_000_000.0
RUNNING, WAITING, ENDED = 12, 8, 10
"""Goals by how they stand."""
WORK = "pick(object=cup_3, place=kitchen)"


def busy_fleet() -> FleetView:
    """Ended plans, two that run, one to approve, a stop, a pause, a question, a failure."""
    view = FleetView()
    for number in range(1, 31):
        name = f"bring-the-cup-{number}-to-the-living-room"
        view.goals[name] = Goal(goal=name, text=f"Bring cup {number}.", ordinal=number)
        view.goal_status[name] = _goal(name, number)
    for number in range(1, 9):
        view.plan_status[f"plan-{number}"] = _plan(number, list(view.goals))
    for number in range(1, 21):
        robot = f"r{number}"
        view.robot_specs[robot] = RobotSpec(robot=robot, model="hsr", skills=(), capabilities={})
        busy = number <= RUNNING
        view.robot_states[robot] = RobotState(
            robot=robot,
            incarnation="i",
            activity=RobotActivity.BUSY if busy else RobotActivity.IDLE,
            place="kitchen",
            plan="plan-7" if busy else None,
            task=f"t{number}" if busy else None,
            stops=("s1",) if number == 20 else (),
            time_s=NOW_S,
        )
    for number in range(1, 61):
        record = _task(number)
        view.tasks[record.plan, record.task] = record
    view.stops["s1"] = Stop(
        stop="s1", robots=("r19", "r20"), by="ana@lab", reason="smoke", wall_time_s=NOW_S
    )
    view.holds["h1"] = Hold(
        hold="h1",
        kind=HoldKind.PAUSE,
        robots=("r18",),
        by="bob@lab",
        reason="cleaning",
        wall_time_s=NOW_S,
    )
    return view


def _goal(name: str, number: int) -> GoalStatus:
    state, plan, reason, waits = GoalState.RUNNING, "plan-7", None, ()
    candidates: tuple[str, ...] = ()
    if number > RUNNING:
        state, plan = GoalState.PLANNED, "plan-8"
        waits = (WaitReason(kind=WaitKind.PLAN, plan="plan-8"),)
    if number > RUNNING + WAITING - 2:
        state, plan = GoalState.WAITING, None
        waits = (WaitReason(kind=WaitKind.NO_PLAN),)
    if number > RUNNING + WAITING:
        state, plan, waits = GoalState.REACHED, "plan-1", ()
    if number == 29:
        state, reason = GoalState.FAILED, "no robot can lift cup_29: it weighs 9 kg"
    if number == 30:
        state, reason = GoalState.REJECTED, "'the cup' can be two things"
        waits = (WaitReason(kind=WaitKind.QUESTION, goal=name, sentence=reason),)
        candidates = ("bring cup 1", "bring cup 2")
    return GoalStatus(
        goal=name,
        state=state,
        plan=plan,
        reason=reason,
        waits_for=waits,
        candidates=candidates,
        time_s=NOW_S,
        wall_time_s=NOW_S,
    )


def _plan(number: int, goals: list[str]) -> PlanStatus:
    state, waits = PlanState.SUCCEEDED, ()
    mine = tuple(goals[20:28])
    if number == 6:
        state, mine = PlanState.RUNNING, ()
        waits = (WaitReason(kind=WaitKind.PAUSED, plan="plan-6", hold="h2"),)
    elif number == 7:
        state, mine = PlanState.RUNNING, tuple(goals[:RUNNING])
    elif number == 8:
        state, mine = PlanState.PROPOSED, tuple(goals[RUNNING:18])
        waits = (WaitReason(kind=WaitKind.APPROVAL, plan="plan-8"),)
    return PlanStatus(
        plan=f"plan-{number}",
        revision=number % 3 + 1,
        state=state,
        goals=mine,
        time_s=NOW_S,
        wall_time_s=NOW_S,
        waits_for=waits,
    )


def _task(number: int) -> TaskRecord:
    robot = f"r{(number - 1) % 20 + 1}"
    state, waits = TaskState.WAITING, ()
    if number <= RUNNING:
        state = TaskState.RUNNING
    elif number <= 20:
        waits = (WaitReason(kind=WaitKind.BUSY, robot=robot, plan="plan-6", task="t1"),)
    elif number <= 40:
        waits = (WaitReason(kind=WaitKind.TASK, plan="plan-7", task=f"t{number - 20}"),)
    else:
        state = TaskState.SUCCEEDED
    return TaskRecord(
        plan="plan-7",
        revision=2,
        task=f"t{number}",
        skill="pick",
        args={"robot": robot, "object": f"cup_{number}", "place": "kitchen"},
        actor="a1",
        robot=robot,
        state=state,
        goal=f"bring-the-cup-{number % 12 + 1}-to-the-living-room",
        duration_s=30.0,
        started_s=NOW_S - 10.0 if state is TaskState.RUNNING else None,
        wall_time_s=NOW_S - 10.0,
        waits_for=waits,
    )
