"""Finds the configuration files that a person names: missions, worlds, robots, skills, models.

What is shipped is `configs/` at the root of the source tree, and the package `robotfleet_configs`
beside this one where it was installed as a wheel.
"""

from __future__ import annotations

from pathlib import Path

from keyexpr_schema.errors import NoConfigFile

_BESIDE = Path(__file__).resolve().parents[1]
SHIPPED = next(
    (_BESIDE / name for name in ("robotfleet_configs", "configs") if (_BESIDE / name).is_dir()),
    _BESIDE / "robotfleet_configs",
)
"""The configuration that comes with the packages."""
_SUFFIXES = (".yaml", ".yml")


def config_folders(kind: str) -> tuple[Path, ...]:
    """Where files of a kind (`missions`, …) are looked for: what is a person's own goes first."""
    return Path("configs") / kind, SHIPPED / kind


def config_file(kind: str, name: str | Path, named_in: Path | None = None) -> Path:
    """The file that `name` stands for: a path, or the name of a file of that kind.

    A path is as given, or relative to the file `named_in` it. A name is looked for beside that
    file's own folder, then in `config_folders`; if it is in none, it may be a file right here.

    Raises:
        NoConfigFile: no file has that name; the message lists those that there are and where they
            were looked for.
    """
    given = Path(name)
    if given.suffix in _SUFFIXES or len(given.parts) > 1:
        return given if named_in is None else named_in.parent / given
    folders = config_folders(kind)
    if named_in is not None and (beside := named_in.parent.parent / kind) not in folders:
        folders = beside, *folders
    for folder in folders:
        if is_file(folder / f"{given}.yaml"):
            return folder / f"{given}.yaml"
    if is_file(given):
        return given
    files = (file for folder in folders for file in folder.glob("*.yaml"))
    looked_in = {folder.resolve(): str(folder) for folder in reversed(folders)}
    known = sorted({file.stem for file in files if not file.stem.endswith(".model")})
    raise NoConfigFile(
        f"there is no {kind.removesuffix('s')} {str(given)!r}; there are "
        f"{', '.join(known) or 'none'} (looked in {', '.join(reversed(looked_in.values()))}), "
        "or give the path of a file"
    )


def is_file(path: Path) -> bool:
    """Whether a file is there; a name that no file can have names none."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
