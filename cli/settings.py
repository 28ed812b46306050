"""Where robotctl finds its fleet: flag, environment, file, what `robotctl up` runs, default."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cli.errors import BadSettings

if TYPE_CHECKING:
    from cli.processes.up_state import UpState
    from keyexpr_schema.transport.zenoh_file import ZenohFile
    from keyexpr_schema.yaml_reader import YamlFile

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
DEFAULT_REALM = "robotfleet"
_REALM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,62}", re.ASCII)
_FIELDS = ("router", "realm", "as", "zenoh_config", "planner", "limits")
LONGEST_NAME = 100
LEAST_PLANNING_LIMIT_S = 1.0
"""Allocating alone takes as long."""


@dataclass(frozen=True)
class PlannerSettings:
    """How `robotctl planner` behaves where no flag says so; `None` and empty: it is not given.

    Files are relative to the folder of the configuration file. `lost_after_s`,
    `lease_s` and `planning_limit_s` are wall time [s].
    """

    approval: bool | None = None
    auto_plan: bool | None = None
    lost_after_s: float | None = None
    lease_s: float | None = None
    keep_days: float | None = None
    keep: int | None = None
    planning_limit_s: float | None = None
    llm_config: Path | None = None
    skills: tuple[Path, ...] = ()
    tasks: tuple[Path, ...] = ()
    words: tuple[Path, ...] = ()


_PLANNER_FIELDS = tuple(field.name for field in fields(PlannerSettings))


@dataclass(frozen=True)
class Settings:
    """What every command needs: `routers` are Zenoh endpoints, `realm` the session namespace, `by`
    who gives it where that is not `user@host`.

    `said`: somebody has said which router, in a flag, the environment or a file. `zenoh`
    is a Zenoh configuration file that was read and is right; `routers` may be empty then, where a
    router is found by multicast. `of_up`: it is that of the `robotctl up` that runs.
    """

    routers: tuple[str, ...] = (DEFAULT_ROUTER,)
    realm: str = DEFAULT_REALM
    json: bool = False
    by: str | None = None
    planner: PlannerSettings = PlannerSettings()
    said: bool = False
    zenoh: ZenohFile | None = None
    of_up: bool = False
    limits: Mapping[str, Any] = field(default_factory=dict)
    """What `robotctl.yaml` says of `keyexpr_schema.limits.Limits`."""

    @property
    def zenoh_config(self) -> Path | None:
        """The file's name, for other processes."""
        return None if self.zenoh is None else self.zenoh.path.absolute()


def load_settings(
    routers: list[str] | None,
    realm: str | None,
    json: bool,
    environ: Mapping[str, str] = os.environ,
    cwd: Path | None = None,
    *,
    by: str | None = None,
    zenoh_config: Path | None = None,
) -> Settings:
    """Settings by precedence: flags (`None`: not given), environment, file, what is up, default.

    Of what is up, that is, of the realm's `robotctl up` on this machine, it is the router, and how
    to connect to it. Before that come the routers that the Zenoh configuration names.

    Raises:
        BadZenohConfig: the Zenoh configuration cannot be read or used.
        BadSettings: a value is not an endpoint or a realm, or a file is not readable; the message
            names where the value came from.
    """
    path = settings_file(environ, cwd)
    written, file = {}, None
    if path is not None:
        from keyexpr_schema.yaml_reader import read_yaml_file

        file = read_yaml_file(path, BadSettings)
        written = _section(file.data, _FIELDS, str(path), f"router: {DEFAULT_ROUTER}")
    chosen_routers, where = _choose(
        routers or None, environ.get("ROBOTFLEET_ROUTER"), written.get("router"), file, "--router"
    )
    chosen_realm, realm_where = _choose(
        realm, environ.get("ROBOTFLEET_REALM"), written.get("realm"), file, "--realm"
    )
    realm_name = _realm(chosen_realm, realm_where)
    said = endpoints(chosen_routers, where)
    zenoh = _zenoh_file(zenoh_config, environ, written, file)
    scouts = False
    if zenoh is not None:
        said, scouts = said or zenoh.connects("client"), zenoh.scouts
    up = None if said or scouts else _up(realm_name, environ)
    found = (DEFAULT_ROUTER,) if up is None else (up.endpoint,)
    of_up = zenoh is None and up is not None and up.zenoh_config is not None
    if up is not None and of_up:
        zenoh = _read_zenoh(Path(str(up.zenoh_config)))
    whom, by_where = _choose(by, environ.get("ROBOTFLEET_AS"), written.get("as"), file, "--as")
    return Settings(
        routers=said or (() if scouts else found),
        realm=realm_name,
        said=bool(said),
        zenoh=zenoh,
        of_up=of_up,
        json=json,
        by=_name(whom, by_where),
        planner=_planner(written.get("planner"), file) if file else PlannerSettings(),
        limits=_limits(written.get("limits"), file) if file else {},
    )


def settings_file(environ: Mapping[str, str], cwd: Path | None = None) -> Path | None:
    """The configuration file in force, if there is one.

    Raises:
        BadSettings: `ROBOTFLEET_CONFIG` names a file that does not exist.
    """
    named = environ.get("ROBOTFLEET_CONFIG")
    if named:
        path = Path(named).expanduser()
        if not path.is_file():
            raise BadSettings(f"ROBOTFLEET_CONFIG names {named!r}, which is not a file")
        return path
    home = environ.get("HOME")
    candidates = [(cwd or Path.cwd()) / "robotctl.yaml"]
    if home:
        candidates.append(Path(home) / ".config" / "robotfleet" / "robotctl.yaml")
    return next((path for path in candidates if path.is_file()), None)


def _zenoh_file(
    flag: Path | None, environ: Mapping[str, str], written: dict[str, Any], file: YamlFile | None
) -> ZenohFile | None:
    """The Zenoh configuration in force, if there is one; in a file it is relative to its folder."""
    named = flag or environ.get("ROBOTFLEET_ZENOH_CONFIG")
    if not named:
        named = written.get("zenoh_config")
        if named is None or file is None:
            return None
        if not isinstance(named, str):
            raise BadSettings(f"{file.at('zenoh_config')}: {named!r} is not the name of a file")
        named = Path(file.name).parent / Path(named).expanduser()
    return _read_zenoh(Path(named).expanduser())


def _read_zenoh(path: Path) -> ZenohFile:
    from keyexpr_schema.transport.zenoh_file import read_zenoh_file

    return read_zenoh_file(path)


def _up(realm: str, environ: Mapping[str, str]) -> UpState | None:
    from cli.processes.up_state import running_state, state_folder

    up = running_state(state_folder(realm, environ))
    return up if up and up.endpoint else None


def _section(written: object, known: tuple[str, ...], where: str, example: str) -> dict[str, Any]:
    if written is None:
        return {}
    if not isinstance(written, dict):
        raise BadSettings(f"{where} must hold fields such as {example!r}")
    for name in written:
        if name not in known:
            raise BadSettings(f"{where} has no field {name!r}; valid are: {', '.join(known)}")
    return written


def _choose(
    flag: object, env: str | None, written: object, file: YamlFile | None, name: str
) -> tuple[object, str]:
    if flag is not None:
        return flag, name
    if env:
        return env, f"ROBOTFLEET_{name.removeprefix('--').upper()}"
    return written, f"{file}{file.line(name.removeprefix('--'))}" if file else ""


def endpoints(value: object, where: str, *, listens: bool = False) -> tuple[str, ...]:
    """The Zenoh endpoints of a list, or of a text that separates them by commas or spaces.

    `listens`: a router listens on them, and the system may choose the port.

    Raises:
        BadSettings: one is none; the message says `where` it was written.
    """
    if value is None:
        return ()
    entries = value.replace(",", " ").split() if isinstance(value, str) else value
    if not isinstance(entries, list):
        raise BadSettings(f"{where}: router must be an endpoint or a list of endpoints")
    from keyexpr_schema.endpoints import check_endpoints
    from keyexpr_schema.errors import BadEndpoint

    try:
        check_endpoints(map(str, entries), listens=listens)
    except BadEndpoint as error:
        raise BadSettings(f"{where}: {error}") from None
    return tuple(map(str, entries))


def _realm(value: object, where: str) -> str:
    if value is None:
        return DEFAULT_REALM
    if not isinstance(value, str) or not _REALM.fullmatch(value):
        raise BadSettings(
            f"{where}: {value!r} is not a realm; use 1 to 63 ASCII letters, digits, '_', '.' "
            "or '-', starting with a letter or a digit"
        )
    return value


def _name(value: object, where: str) -> str | None:
    if value is None:
        return None
    named = value.strip() if isinstance(value, str) else ""
    if not named or not named.isprintable() or len(named) > LONGEST_NAME:
        raise BadSettings(
            f"{where}: {value!r} does not say who gives the command; use a name such as ana@lab, "
            f"of no more than {LONGEST_NAME} characters"
        )
    return named


def _limits(section: object, file: YamlFile) -> dict[str, Any]:
    if section is None:
        return {}
    from keyexpr_schema.limits import FIELDS

    written = _section(section, FIELDS, file.at("limits"), "goals: 5000")
    for name, value in written.items():
        kinds = (int, float) if name.endswith("_s") else (int,)
        if not isinstance(value, kinds) or isinstance(value, bool) or not 0 < value < math.inf:
            what = "a number above 0" if name.endswith("_s") else "a whole number from 1 up"
            raise BadSettings(f"{file.at(f'limits.{name}')}: {value!r} is not {what}")
    return written


def _planner(section: object, file: YamlFile) -> PlannerSettings:
    folder = Path(file.name).parent
    written = _section(section, _PLANNER_FIELDS, file.at("planner"), "approval: true")

    def check(name: str, right: bool, what: str) -> None:
        if written.get(name) is not None and not right:
            raise BadSettings(f"{file.at(f'planner.{name}')}: {written[name]!r} is not {what}")

    for name in ("approval", "auto_plan"):
        check(name, isinstance(written.get(name), bool), "true or false")
    keep = written.get("keep")
    is_count = isinstance(keep, int) and not isinstance(keep, bool) and keep >= 0
    check("keep", is_count, "a whole number from 0 up")

    def number(name: str, least: float, unit: str = "seconds") -> float | None:
        value = written.get(name)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        found = float(value or 0.0) if is_number else -math.inf
        check(name, least <= found < math.inf, f"a number of {unit} from {least:g} up")
        return None if value is None else found

    check("llm_config", isinstance(written.get("llm_config"), str), "the name of a file")

    def files(name: str) -> tuple[Path, ...]:
        names = written.get(name) or []
        names = [names] if isinstance(names, str) else names
        is_list = isinstance(names, list) and all(isinstance(each, str) for each in names)
        check(name, is_list, "the name of a file or a list of such")
        return tuple(folder / Path(each).expanduser() for each in names)

    llm = written.get("llm_config")
    return PlannerSettings(
        approval=written.get("approval"),
        auto_plan=written.get("auto_plan"),
        lost_after_s=number("lost_after_s", 0.0),
        lease_s=number("lease_s", 0.0),
        keep_days=number("keep_days", 0.0, "days"),
        keep=keep,
        planning_limit_s=number("planning_limit_s", LEAST_PLANNING_LIMIT_S),
        llm_config=None if llm is None else folder / Path(llm).expanduser(),
        skills=files("skills"),
        tasks=files("tasks"),
        words=files("words"),
    )
