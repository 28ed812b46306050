from pathlib import Path
from typing import Any

from rich.console import Console


def show(part: str, about: dict[str, Any], console: Console) -> None:
    console.print(part, about["took_s"], about["load_before"], about["load_after"])
    for row in about["results"]:
        console.print(row)


def write(folder: Path) -> None: ...
