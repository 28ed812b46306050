"""A folder in which an installed package lies that offers plug-ins."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


def plug_in_site(folder: Path, code: str, entries: Mapping[str, Mapping[str, str]]) -> Path:
    """Package `theirs` with one module of this code; `entries` are by group and name."""
    (folder / "theirs.py").write_text(code)
    info = folder / "theirs-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1\n")
    text = "".join(
        f"[{group}]\n" + "".join(f"{name} = theirs:{what}\n" for name, what in offered.items())
        for group, offered in entries.items()
    )
    (info / "entry_points.txt").write_text(text)
    return folder
