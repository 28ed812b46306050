"""Finds the configuration files that a person names: missions, worlds, robots, skills, models.

What is shipped is `configs/` at the root of the source tree, and the package `robotfleet_configs`
beside this one where it was installed as a wheel.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
        if (folder / f"{given}.yaml").is_file():
            return folder / f"{given}.yaml"
    if given.is_file():
        return given
    files = (file for folder in folders for file in folder.glob("*.yaml"))
    looked_in = {folder.resolve(): str(folder) for folder in reversed(folders)}
    known = sorted({file.stem for file in files if not file.stem.endswith(".model")})
    raise NoConfigFile(
        f"there is no {kind.removesuffix('s')} {str(given)!r}; there are "
        f"{', '.join(known) or 'none'} (looked in {', '.join(reversed(looked_in.values()))}), "
        "or give the path of a file"
    )


def read_yaml(path: Path, error: type[Exception]) -> Any:
    """What a YAML (or JSON) file holds.

    Raises:
        error: it cannot be read or is neither; the message is one sentence.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as reason:
        raise error(f"{path} cannot be read: {reason.strerror}") from None
    except UnicodeDecodeError:
        raise error(f"{path} cannot be read: it is not UTF-8 text") from None
    return parsed_yaml(text, error, str(path))


def parsed_yaml(text: str, error: type[Exception], where: str) -> Any:
    """What a text of YAML (or JSON) holds; `where` is the path of its file.

    Raises:
        error: it is neither; the message is one sentence.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """YAML forbids a name that comes twice; PyYAML forgets the first without a word."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
            check_names(node)
            return super().construct_mapping(node, deep)

    try:
        return yaml.load(text, Loader)
    except yaml.YAMLError as reason:
        kind = "JSON" if where.endswith(".json") else "YAML"
        mark, problem = getattr(reason, "problem_mark", None), getattr(reason, "problem", None)
        if mark is None or problem is None:
            raise error(f"{where} is not {kind}: {' '.join(str(reason).split())}") from None
        at = f"line {mark.line + 1}, column {mark.column + 1}"
        raise error(f"{where} is not {kind}: {at}: {problem}") from None


def check_names(node: Any) -> None:
    """Whether no name of a YAML mapping (a `yaml.MappingNode`) comes twice.

    Raises:
        yaml.constructor.ConstructorError: one does.
    """
    import yaml

    seen: set[str] = set()
    for name, _ in node.value:
        if not isinstance(name, yaml.ScalarNode):
            continue
        if name.value in seen:
            raise yaml.constructor.ConstructorError(
                None, None, f"{name.value!r} comes twice", name.start_mark
            )
        seen.add(str(name.value))
