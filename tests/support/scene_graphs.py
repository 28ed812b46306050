"""A small home of our own in the form of COHERENT's files: two rooms, a door, a dog, a quadrotor
with a basket, and an arm on a high counter.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

HALL, HALL_FLOOR, STUDY, STUDY_FLOOR, DOOR = 1, 2, 3, 4, 5
DOG, QUADROTOR, ARM, BASKET = 10, 11, 12, 13
BENCH, COUNTER, CHEST, PEN, VASE, JAR = 20, 21, 22, 30, 31, 32

Row = tuple[int, str, str, list[str], list[str]]
NODES: tuple[Row, ...] = (
    (HALL, "Rooms", "hall", [], []),
    (HALL_FLOOR, "Floor", "hall floor", ["SURFACES", "LANDABLE", "LOW_HEIGHT"], []),
    (STUDY, "Rooms", "study", [], []),
    (STUDY_FLOOR, "Floor", "study floor", ["SURFACES", "LANDABLE", "LOW_HEIGHT"], []),
    (DOOR, "Doors", "door", ["CAN_OPEN"], ["CLOSED"]),
    (DOG, "Agents", "robot dog", [], []),
    (QUADROTOR, "Agents", "quadrotor", [], ["LAND"]),
    (ARM, "Agents", "robot arm", ["ON_HIGH_SURFACE"], []),
    (BASKET, "AgentTool", "basket", ["CONTAINERS"], ["OPEN_FOREVER"]),
    (BENCH, "Furniture", "bench", ["SURFACES", "LOW_HEIGHT"], []),
    (COUNTER, "Furniture", "counter", ["SURFACES", "LANDABLE", "HIGH_HEIGHT"], []),
    (CHEST, "Furniture", "chest", ["CONTAINERS", "CAN_OPEN"], ["CLOSED"]),
    (PEN, "Things", "pen", ["GRABABLE"], []),
    (VASE, "Things", "vase", ["GRABABLE", "ON_HIGH_SURFACE"], []),
    (JAR, "Things", "jar", ["GRABABLE", "CONTAINERS", "ON_HIGH_SURFACE"], ["OPEN_FOREVER"]),
)
EDGES: tuple[tuple[int, str, int], ...] = (
    (HALL_FLOOR, "INSIDE", HALL),
    (STUDY_FLOOR, "INSIDE", STUDY),
    (DOOR, "LEADING TO", HALL),
    (DOOR, "LEADING TO", STUDY),
    (DOG, "INSIDE", HALL),
    (DOG, "ON", HALL_FLOOR),
    (QUADROTOR, "INSIDE", HALL),
    (QUADROTOR, "ON", HALL_FLOOR),
    (QUADROTOR, "WITH", BASKET),
    (BASKET, "ON", HALL_FLOOR),
    (ARM, "INSIDE", STUDY),
    (ARM, "ON", COUNTER),
    (BENCH, "ON", HALL_FLOOR),
    (COUNTER, "ON", STUDY_FLOOR),
    (CHEST, "ON", HALL_FLOOR),
    (PEN, "INSIDE", CHEST),
    (VASE, "ON", COUNTER),
    (JAR, "ON", COUNTER),
)


def task_row(
    goal: Sequence[tuple[int, str, int]],
    reference: int,
    number: int = 0,
    nodes: Sequence[Row] = NODES,
    edges: Sequence[tuple[int, str, int]] = EDGES,
) -> Mapping[str, Any]:
    """One task as a file of the set has it."""
    names = {row[0]: row[2] for row in nodes}
    return {
        "task_id": number,
        "env_id": 7,
        "init_graph": {
            "nodes": [
                {
                    "id": id_,
                    "category": category,
                    "class_name": name,
                    "prefab_name": name,
                    "properties": properties,
                    "states": states,
                }
                for id_, category, name, properties, states in nodes
            ],
            "edges": [{"from_id": a, "to_id": b, "relation_type": r} for a, r, b in edges],
        },
        "task_goal": {
            f"{relation.lower()}_<{names[a]}>({a})_<{names[b]}>({b})": [1, []]
            for a, relation, b in goal
        },
        "ground_truth_step_num": [reference],
        "goal_instruction": ["In other words."],
    }


def written(folder: Path, *rows: Mapping[str, Any], name: str = "env7.json") -> Path:
    """A folder with one file of these tasks."""
    folder.joinpath(name).write_text(json.dumps(rows), encoding="utf-8")
    return folder
