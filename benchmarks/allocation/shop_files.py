"""Public job-shop and flexible job-shop instances, in the usual text formats, as shops.

Job shop (`.txt`, Beasley's OR-Library): `jobs machines`, then for each job a line of pairs
`machine duration` with machines from 0. Flexible job shop (`.fjs`, Brandimarte): `jobs machines`
(and perhaps a mean flexibility), then for each job the number of operations, and for each of them
the number of machines and pairs `machine duration` with machines from 1. Lines with `#` are
remarks; the remark `# optimum N` gives the least makespan known to be optimal.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from fleet.jobshop.problem import Block, Machine, Operation, Shop

INSTANCES = Path(__file__).with_name("instances")
NAMES = ("ft06", "la01", "la02", "la03", "la04", "la05", "mk01", "mk02", "mk03")


class BadInstance(ValueError):
    """A file is not in one of the two formats; the message says where."""


@dataclass(frozen=True)
class Instance:
    """A shop with its name and its known optimum [s, as the files' unit], if the file says one."""

    name: str
    shop: Shop
    optimum_s: float | None


def load(name: str) -> Instance:
    """One of `NAMES`."""
    for suffix in (".txt", ".fjs"):
        path = INSTANCES / f"{name}{suffix}"
        if path.exists():
            return read_instance(path)
    raise BadInstance(f"there is no instance {name}; there are {', '.join(NAMES)}")


def read_instance(path: Path) -> Instance:
    """The instance in a file; `.fjs` is a flexible job shop, anything else a job shop.

    Raises:
        BadInstance: the file is not in the format.
        OSError: it cannot be read.
    """
    text = path.read_text(encoding="utf-8")
    optimum = re.search(r"^#\s*optimum\s+(\d+)", text, re.M)
    rows = [line.split() for line in text.splitlines() if line.strip() and line[0] != "#"]
    try:
        jobs, machines = int(rows[0][0]), int(rows[0][1])
        flexible = path.suffix == ".fjs"
        parsed = [(_flexible if flexible else _plain)(list(map(int, row))) for row in rows[1:]]
    except (ValueError, IndexError) as error:
        raise BadInstance(f"{path}: {error}") from None
    if len(parsed) != jobs:
        raise BadInstance(f"{path}: the first line says {jobs} jobs, and there are {len(parsed)}")
    shop = _shop(parsed, machines)
    return Instance(path.stem, shop, float(optimum[1]) if optimum else None)


_Job = list[dict[int, int]]
"""Of each operation in order: machine to duration."""


def _plain(row: list[int]) -> _Job:
    if len(row) % 2:
        raise ValueError(f"a job has {len(row)} numbers: there must be pairs of machine, duration")
    return [{machine: time} for machine, time in zip(row[::2], row[1::2], strict=True)]


def _flexible(row: list[int]) -> _Job:
    numbers = iter(row)
    job: _Job = []
    try:
        for _ in range(next(numbers)):
            choices = next(numbers)
            job.append({next(numbers) - 1: next(numbers) for _ in range(choices)})
    except StopIteration:
        raise ValueError("a job's line ends too early") from None
    if next(numbers, None) is not None:
        raise ValueError("a job's line is too long")
    return job


def _shop(jobs: list[_Job], machines: int) -> Shop:
    """Every operation is a block of its own, every machine a kind of its own."""
    operations: list[Operation] = []
    blocks: list[Block] = []
    for job in jobs:
        for number, choices in enumerate(job):
            here = len(operations)
            operations.append(
                Operation(
                    blocks=(here,),
                    duration_s=tuple(float(choices.get(m, 0)) for m in range(machines)),
                    after=(here - 1,) if number else (),
                    weight=1.0 if number == len(job) - 1 else 0.0,
                )
            )
            blocks.append(Block((here,), tuple(sorted(choices))))
    return Shop(tuple(operations), tuple(blocks), tuple(Machine(kind=m) for m in range(machines)))
