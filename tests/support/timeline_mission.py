"""A scripted mission for the recorder: two robots, two cups, one try that fails, one discovery.

Built from the same payloads that the fleet puts on its keys. Poses follow straight lines at
0.5 m/s; the room is that of `configs/worlds/home.yaml`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, cos, hypot, sin
from pathlib import Path
from typing import Any

import msgspec
import yaml

from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.recorder import Recorder
from keyexpr_schema import keyspace as keys
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.key import Key
from keyexpr_schema.payloads.goals import Condition, Goal, GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState, PlanStatus, Task
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotSpec, RobotState
from keyexpr_schema.payloads.simulation import (
    Body,
    Frame,
    Frames,
    Scene,
    Shape,
    ShapeKind,
    SimAddress,
    SimClock,
    Truth,
    TruthAddress,
)
from keyexpr_schema.payloads.tasks import (
    Order,
    OrderAddress,
    Report,
    ReportAddress,
    ReportState,
    TaskAddress,
    TaskRecord,
    TaskState,
    Try,
)
from keyexpr_schema.payloads.world import Fact, FactAddress, Place, PlaceAddress

WALL_S = 1_760_000_000.0
UPRIGHT = (1.0, 0.0, 0.0, 0.0)
HOME = Path(__file__).parents[2] / "configs" / "worlds" / "home.yaml"
SPEED_M_S = 0.5


@dataclass(frozen=True)
class Put:
    """A change as the session delivers it."""

    key: Key[Any, Any]
    address: Any
    value: Any
    timestamp: str


def put(key: Key[Any, Any], address: Any, value: Any, time_s: float) -> Put:
    """`value` was written when the fleet's clock showed `time_s`."""
    return Put(key, address, value, f"{int((WALL_S + time_s) * 2**32)}/33")


def box(half: tuple[float, float, float], at: tuple[float, float, float], rgb: Any) -> Shape:
    return Shape(
        kind=ShapeKind.BOX, size_m=half, point_m=at, quaternion_wxyz=UPRIGHT, rgba=(*rgb, 1.0)
    )


def cylinder(radius: float, half: float, z: float, rgb: Any) -> Shape:
    return Shape(
        kind=ShapeKind.CYLINDER,
        size_m=(radius, half, 0.0),
        point_m=(0.0, 0.0, z),
        quaternion_wxyz=UPRIGHT,
        rgba=(*rgb, 1.0),
    )


def robot_bodies(robot: str, arm: bool) -> list[Body]:
    grey, dark = (0.85, 0.85, 0.88), (0.25, 0.27, 0.3)
    shapes = [cylinder(0.22, 0.12, 0.14, grey), box((0.08, 0.08, 0.25), (-0.05, 0, 0.5), dark)]
    if not arm:
        shapes = [
            cylinder(0.2, 0.1, 0.12, dark),
            box((0.16, 0.16, 0.01), (0, 0, 0.3), grey),
            box((0.16, 0.01, 0.05), (0, 0.16, 0.35), grey),
            box((0.16, 0.01, 0.05), (0, -0.16, 0.35), grey),
        ]
    bodies = [Body(body=f"{robot}/base", owner=robot, shapes=tuple(shapes))]
    if arm:
        sphere = Shape(
            kind=ShapeKind.SPHERE,
            size_m=(0.1, 0.0, 0.0),
            point_m=(0.0, 0.0, 0.85),
            quaternion_wxyz=UPRIGHT,
            rgba=(*grey, 1.0),
        )
        reach = Shape(
            kind=ShapeKind.CAPSULE,
            size_m=(0.04, 0.15, 0.0),
            point_m=(0.2, 0.0, 0.65),
            quaternion_wxyz=(0.7071068, 0.0, 0.7071068, 0.0),
            rgba=(0.3, 0.35, 0.4, 1.0),
        )
        bodies.append(Body(body=f"{robot}/arm", owner=robot, shapes=(sphere, reach)))
    return bodies


def scene() -> Scene:
    """The home, two robots and two cups."""
    world = yaml.safe_load(HOME.read_text())
    width, depth = world["size_m"]
    high = world["wall_height_m"] / 2
    walls = [((0, 0), (width, 0)), ((0, depth), (width, depth)), ((0, 0), (0, depth))]
    walls += [((width, 0), (width, depth))]
    for x in (4.0, 6.0):
        walls += [((x, 0), (x, 2.5)), ((x, 3.5), (x, depth))]
    shapes = [
        box(
            (max(0.05, abs(b[0] - a[0]) / 2), max(0.05, abs(b[1] - a[1]) / 2), high),
            ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2, high),
            (0.75, 0.73, 0.7),
        )
        for a, b in walls
    ]
    bodies = [Body(body="walls", owner=None, shapes=tuple(shapes))]
    fixed = {"walls": ((0.0, 0.0, 0.0), UPRIGHT)}
    for name, thing in world["furniture"].items():
        length, wide, tall = thing["size_m"]
        shape = box((length / 2, wide / 2, tall / 2), (0, 0, tall / 2), (0.55, 0.4, 0.28))
        if thing["kind"] == "table":
            shape = box((length / 2, wide / 2, 0.02), (0, 0, tall - 0.02), (0.6, 0.45, 0.3))
        bodies.append(Body(body=name, owner=None, shapes=(shape,)))
        fixed[name] = ((*map(float, thing["center_m"]), 0.0), UPRIGHT)
    bodies += robot_bodies("hsr", arm=True) + robot_bodies("locobot", arm=False)
    for cup, thing in world["objects"].items():
        shape = cylinder(0.035, 0.05, 0.05, thing["rgba"][:3])
        bodies.append(Body(body=cup, owner=cup, shapes=(shape,)))
    return Scene(world="home", bodies=tuple(bodies), fixed=fixed)


@dataclass(frozen=True)
class Step:
    """A task of the script: who does what from when to when, and where it ends."""

    task: str
    skill: str
    args: dict[str, str]
    robot: str
    after: tuple[str, ...]
    start_s: float
    end_s: float
    to_m: tuple[float, float]
    goal: str
    holds: str | None = None  # a cup that goes along afterwards
    puts: tuple[float, float, float] | None = None  # where the held cup ends up
    tries: tuple[Try, ...] = ()


STEPS: tuple[Step, ...] = (
    Step(
        "t1", "navigate", {"robot": "hsr", "place": "kitchen"}, "hsr", (), 2, 15, (2.0, 3.6), "g1"
    ),
    Step(
        "t2",
        "search",
        {"robot": "hsr", "object": "cup_1"},
        "hsr",
        ("t1",),
        15,
        21,
        (1.4, 4.1),
        "g1",
    ),
    Step(
        "t3",
        "pick",
        {"robot": "hsr", "object": "cup_1"},
        "hsr",
        ("t2",),
        21,
        36,
        (0.8, 4.2),
        "g1",
        holds="cup_1",
        tries=(
            Try(number=1, started_s=21.0, ended_s=28.0, reason="the hand closed on nothing"),
            Try(number=2, started_s=28.0, ended_s=36.0),
        ),
    ),
    Step(
        "t4",
        "navigate",
        {"robot": "locobot", "place": "kitchen"},
        "locobot",
        (),
        2,
        13,
        (2.6, 4.4),
        "g1",
    ),
    Step(
        "t5",
        "place_on_robot",
        {"robot": "hsr", "object": "cup_1", "carrier": "locobot"},
        "hsr",
        ("t3", "t4"),
        36,
        45,
        (2.1, 4.4),
        "g1",
        puts=(2.6, 4.4, 0.31),
    ),
    Step(
        "t6",
        "navigate",
        {"robot": "locobot", "place": "hallway"},
        "locobot",
        ("t5",),
        45,
        54,
        (5.0, 3.0),
        "g1",
    ),
    Step(
        "t7",
        "pick",
        {"robot": "hsr", "object": "cup_2"},
        "hsr",
        ("t5",),
        45,
        56,
        (1.3, 4.2),
        "g2",
        holds="cup_2",
    ),
    Step(
        "t8",
        "navigate",
        {"robot": "hsr", "place": "living_room"},
        "hsr",
        ("t7",),
        56,
        76,
        (8.2, 4.2),
        "g2",
    ),
    Step(
        "t9",
        "place",
        {"robot": "hsr", "object": "cup_2", "place": "living_room"},
        "hsr",
        ("t8",),
        76,
        85,
        (8.3, 4.3),
        "g2",
        puts=(8.3, 5.0, 0.45),
    ),
)
END_S = 88.0
ACTORS = {"hsr": "a1", "locobot": "a2"}


def record(step: Step, state: TaskState, attempt: int = 1, **more: Any) -> TaskRecord:
    return TaskRecord(
        plan="p1",
        revision=1,
        task=step.task,
        skill=step.skill,
        args=step.args,
        actor=ACTORS[step.robot],
        robot=step.robot,
        state=state,
        after=step.after,
        goal=step.goal,
        attempt=attempt,
        duration_s=step.end_s - step.start_s,
        **more,
    )


def plan() -> Plan:
    tasks = tuple(
        Task(
            task=step.task,
            skill=step.skill,
            args={k: actor_arg(ACTORS[v]) if v in ACTORS else v for k, v in step.args.items()},
            actor=ACTORS[step.robot],
            after=step.after,
            goal=step.goal,
            duration_s=step.end_s - step.start_s,
        )
        for step in STEPS
    )
    return Plan(plan="p1", goals=("g1", "g2"), conditions=(), tasks=tasks)


def script() -> list[Put]:
    """Everything but the clock and the frames, in the order of writing."""
    puts = [put(keys.SIM_SCENE, SimAddress(), scene(), 0.0)]
    world = yaml.safe_load(HOME.read_text())
    for name, thing in world["places"].items():
        region = tuple(tuple(map(float, box)) for box in thing["region_m"])
        place = Place(place=name, label=thing["label"], region_m=region)
        puts.append(put(keys.PLACE, PlaceAddress(place=name), place, 0.0))
    for robot, label, skills in (
        ("hsr", "HSR", ("navigate", "search", "pick", "place", "place_on_robot")),
        ("locobot", "LoCoBot", ("navigate", "search")),
    ):
        spec = RobotSpec(
            robot=robot, model=robot, label=label, skills=skills, capabilities={"drive": 0.6}
        )
        puts.append(put(keys.ROBOT_SPEC, RobotAddress(robot=robot), spec, 0.1))
        state = RobotState(robot=robot, incarnation="i1", activity=RobotActivity.IDLE, time_s=0.2)
        puts.append(put(keys.ROBOT_STATE, RobotAddress(robot=robot), state, 0.2))
    for number, (text, cup, place) in enumerate(
        (
            ("Bring the first cup to the hallway.", "cup_1", "hallway"),
            ("Bring the second cup to the living room.", "cup_2", "living_room"),
        ),
        1,
    ):
        goal, address = f"g{number}", GoalAddress(goal=f"g{number}")
        puts.append(put(keys.GOAL_SPEC, address, Goal(goal=goal, text=text), 0.5))
        wish = (Condition(relation="at", subject=cup, value=place),)
        for state, at in ((GoalState.PLANNED, 1.2), (GoalState.RUNNING, 2.0)):
            status = GoalStatus(goal=goal, state=state, conditions=wish, plan="p1", time_s=at)
            puts.append(put(keys.GOAL_STATUS, address, status, at))
        ends = 54.3 if number == 1 else 85.4
        status = GoalStatus(
            goal=goal, state=GoalState.REACHED, conditions=wish, plan="p1", time_s=ends
        )
        puts.append(put(keys.GOAL_STATUS, address, status, ends))
        source = put(
            keys.FACT,
            FactAddress(subject=cup, relation="at"),
            Fact(subject=cup, relation="at", value="kitchen", source="person", time_s=0.3),
            0.3,
        )
        puts.append(source)
    puts.append(put(keys.PLAN_SPEC, PlanAddress(plan="p1"), plan(), 1.0))
    for state, at in (
        (PlanState.READY, 1.1),
        (PlanState.RUNNING, 1.9),
        (PlanState.SUCCEEDED, 85.5),
    ):
        status = PlanStatus(
            plan="p1",
            revision=1,
            state=state,
            goals=("g1", "g2"),
            allocation={actor: robot for robot, actor in ACTORS.items()},
            made_by="symbolic",
            time_s=at,
        )
        puts.append(put(keys.PLAN_STATUS, PlanAddress(plan="p1"), status, at))
    for step in STEPS:
        puts += story(step)
    for cup, place, support, holder, at in (
        ("cup_1", "kitchen", "kitchen_table", None, 0.2),
        ("cup_1", "kitchen", None, "hsr", 36.0),
        ("cup_1", "kitchen", "locobot", None, 45.0),
        ("cup_1", "hallway", "locobot", None, 54.0),
        ("cup_2", "living_room", "coffee_table", None, 85.0),
    ):
        truth = Truth(
            object=cup,
            kind="cup",
            time_s=at,
            point_m=(0.0, 0.0, 0.0),
            place=place,
            support=support,
            held_by=holder,
            settled=True,
        )
        puts.append(put(keys.SIM_TRUTH, TruthAddress(object=cup), truth, at))
    return sorted(puts, key=lambda one: int(one.timestamp.split("/")[0]))


def story(step: Step) -> list[Put]:
    """Order, report and record of one task, from waiting to done."""
    task = TaskAddress(plan="p1", task=step.task)
    order = OrderAddress(robot=step.robot, plan="p1", task=step.task)
    said = ReportAddress(robot=step.robot, plan="p1", task=step.task, attempt=1)
    ordered_s = step.start_s - 0.2
    common: dict[str, Any] = {
        "robot": step.robot,
        "plan": "p1",
        "revision": 1,
        "task": step.task,
        "attempt": 1,
        "epoch": 1,
    }
    puts = [
        put(keys.TASK_RECORD, task, record(step, TaskState.WAITING), 1.1),
        put(
            keys.ORDER,
            order,
            Order(**common, skill=step.skill, args=step.args, deadline_s=60.0),
            ordered_s,
        ),
        put(
            keys.TASK_RECORD,
            task,
            record(step, TaskState.ORDERED, ordered_s=ordered_s),
            ordered_s + 0.01,
        ),
        put(
            keys.TASK_RECORD,
            task,
            record(step, TaskState.RUNNING, ordered_s=ordered_s, started_s=step.start_s),
            step.start_s + 0.05,
        ),
        put(
            keys.REPORT,
            said,
            Report(**common, incarnation="i1", state=ReportState.STARTED, started_s=step.start_s),
            step.start_s + 0.02,
        ),
    ]
    for at in range(1, len(step.tries)):
        tried = Report(
            **common,
            incarnation="i1",
            state=ReportState.STARTED,
            tries=step.tries[:at],
            started_s=step.start_s,
        )
        puts.append(put(keys.REPORT, said, tried, step.tries[at - 1].ended_s))
    done = Report(
        **common,
        incarnation="i1",
        state=ReportState.SUCCEEDED,
        tries=step.tries,
        started_s=step.start_s,
        ended_s=step.end_s,
    )
    puts.append(put(keys.REPORT, said, done, step.end_s + 0.03))
    ended = record(
        step,
        TaskState.SUCCEEDED,
        ordered_s=ordered_s,
        started_s=step.start_s,
        ended_s=step.end_s,
        tries=step.tries,
    )
    puts.append(put(keys.TASK_RECORD, task, ended, step.end_s + 0.05))
    return puts


def frames(step_s: float = 0.1) -> Iterator[Put]:
    """Clock and frames, `step_s` of simulated time apart."""
    where = {"hsr": (8.0, 3.0, 3.14), "locobot": (5.0, 1.5, 1.57)}
    cups = {"cup_1": (0.7, 4.8, 0.6), "cup_2": (1.3, 4.8, 0.6)}
    carried: dict[str, tuple[str, float]] = {}
    for i in range(round(END_S / step_s) + 1):
        now = i * step_s
        for step in STEPS:
            if not step.start_s <= now <= step.end_s + step_s:
                continue
            x, y, yaw = where[step.robot]
            stops = [step.to_m]
            if step.skill == "navigate":  # through the doors
                doors = [(6.0, 3.0), (4.0, 3.0)]
                if x < step.to_m[0]:
                    doors.reverse()
                low, high = sorted((x, step.to_m[0]))
                stops = [door for door in doors if low < door[0] < high] + stops
            goal = stops[0]
            rest = hypot(goal[0] - x, goal[1] - y)
            if rest > 1e-6:
                go = min(rest, SPEED_M_S * step_s)
                yaw = atan2(goal[1] - y, goal[0] - x)
                where[step.robot] = (x + go * cos(yaw), y + go * sin(yaw), yaw)
            if now >= step.end_s:
                if step.holds:
                    carried[step.holds] = (step.robot, 0.7)
                if step.puts and step.skill == "place_on_robot":
                    carried[step.args["object"]] = ("locobot", 0.31)
                elif step.puts:
                    carried.pop(step.args["object"], None)
                    cups[step.args["object"]] = step.puts
        poses: dict[str, Any] = {}
        for robot, (x, y, yaw) in where.items():
            turn = (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2))
            poses[f"{robot}/base"] = ((x, y, 0.0), turn)
            if robot == "hsr":
                poses["hsr/arm"] = ((x, y, 0.0), turn)
        for cup, (robot, height) in carried.items():
            x, y, yaw = where[robot]
            ahead = 0.38 if robot == "hsr" else 0.0
            cups[cup] = (x + ahead * cos(yaw), y + ahead * sin(yaw), height)
        for cup, point in cups.items():
            poses[cup] = (point, UPRIGHT)
        clock = SimClock(time_s=now, wall_time_s=WALL_S + now, speed=1.0)
        yield put(keys.SIM_CLOCK, SimAddress(), clock, now)
        yield put(
            keys.SIM_FRAMES, SimAddress(), Frames(frames=(Frame(time_s=now, poses=poses),)), now
        )


def mission(step_s: float = 0.1) -> list[Put]:
    """The whole mission as it would be watched live."""
    everything = [*script(), *frames(step_s)]
    return sorted(everything, key=lambda one: int(one.timestamp.split("/")[0]))


def again(number: int) -> list[Put]:
    """The mission's plan and goals under other names, so many times its length later."""
    later_s = number * END_S
    times = ("time_s", "ordered_s", "started_s", "ended_s")

    def moved(one: Any) -> Any:
        names = {
            name: f"{getattr(one, name)}-{number}"
            for name in ("plan", "goal")
            if isinstance(getattr(one, name, None), str)
        }
        own = {name: getattr(one, name, None) for name in times}
        return msgspec.structs.replace(
            one, **names, **{name: at + later_s for name, at in own.items() if at}
        )

    puts = []
    for change in script():
        stamp = int(change.timestamp.split("/")[0]) + int(later_s * 2**32)
        value = None if change.value is None else moved(change.value)
        puts.append(Put(change.key, moved(change.address), value, f"{stamp}/33"))
    return puts


def written(path: Path, changes: list[Put], backlog: bool = False) -> Path:
    """A recording of these changes: one after the other, or all as what was there before."""
    recorder = Recorder(open_stream(path, "test"))
    if backlog:
        recorder.record_all(changes)
    else:
        for number, change in enumerate(changes):
            recorder.record(change)
            if number % 100 == 0:
                recorder.flush()
    recorder.close()
    return path
