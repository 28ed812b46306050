"""`robotctl init`: configuration of one's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cli.command import Call, single

EDITED = ("missions", "worlds", "robots", "robotctl.yaml")
"""What people begin with; of the rest, a copy would go before what a newer version ships."""


@single
def init(
    call: Call,
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where; else the folder that you are in.")
    ] = Path(),
    everything: Annotated[
        bool,
        typer.Option(
            "--all", help="Skills, tasks, words, routers and the language model's file, too."
        ),
    ] = False,
) -> None:
    """Put missions, worlds and robots to edit into a folder, and a robotctl.yaml.

    A file that is there already stays as it is.
    """
    from cli.views.text import counted
    from keyexpr_schema.config_files import SHIPPED
    from keyexpr_schema.whole_files import make_folder, write_whole

    written, kept = [], []
    for source in sorted(path for path in SHIPPED.rglob("*") if path.is_file()):
        inside = source.relative_to(SHIPPED)
        if "__pycache__" in inside.parts or source.suffix == ".py":
            continue
        if not everything and inside.parts[0] not in EDITED:
            continue
        own = inside.name == "robotctl.yaml"
        target = folder / inside if own else folder / "configs" / inside
        make_folder(target.parent)
        if target.exists():
            kept.append(str(target))
        else:
            write_whole(target, source.read_bytes())
            written.append(str(target))
    there = folder / "configs" / "missions"
    where = "" if folder == Path() else f"cd {folder}; "
    settings = str(folder / "robotctl.yaml")
    beside = f", and {settings}" if settings in written else ""
    count = counted(len(written) - bool(beside), "file")
    lines = [f"wrote {count} to {folder / 'configs'}{beside}"]
    if kept:
        lines.append(f"left {len(kept)} as they were: {', '.join(kept)}")
    lines.append(f"next: edit {there / 'two-cups.yaml'}, then `{where}robotctl up two-cups`")
    call.show({"folder": str(folder), "written": written, "kept": kept}, lambda: "\n".join(lines))
