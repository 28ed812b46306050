"""A wheel in an environment of its own, with no source tree to lean on, carries a mission out."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

from tests.support.demo_process import left_behind

pytestmark = [pytest.mark.e2e, pytest.mark.slow]

ROOT = Path(__file__).parents[2]
PACKAGES = ("keyexpr_schema", "fleet", "workers", "sim", "cli")
SHIPPED = (*PACKAGES, "configs", "pyproject.toml", "setup.py", "README.md", "LICENSE")
PIP = ("-m", "pip", "--disable-pip-version-check", "--no-input")
ENVIRON = {
    name: value
    for name, value in os.environ.items()
    if not name.startswith(("PYTHON", "ROBOTFLEET_"))
}


def run(folder: Path, *command: str | Path) -> str:
    """Stdout of a command that ends well."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        env=ENVIRON,
        capture_output=True,
        text=True,
        timeout=540,
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where wheel and environment are; both are made once."""
    return tmp_path_factory.mktemp("installed")


@pytest.fixture(scope="module")
def wheel(folder: Path) -> Path:
    """Built from a copy, so that nothing is left in the source tree."""
    source, wheels = folder / "source", folder / "wheels"
    source.mkdir()
    for name in SHIPPED:
        if (ROOT / name).is_dir():
            # What other tests' processes compile meanwhile comes and goes.
            compiled = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, source / name, ignore=compiled)
        else:
            shutil.copy(ROOT / name, source / name)
    run(
        folder,
        *(sys.executable, *PIP, "wheel", "--no-deps", "--no-build-isolation", "--no-index"),
        *("-w", wheels, source),
    )
    shutil.rmtree(source)
    [built] = wheels.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(folder: Path, wheel: Path) -> Path:
    """The folder of scripts of an environment with the wheel and, of this one, the dependencies."""
    made = folder / "venv"
    venv.create(made, symlinks=True, with_pip=False)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    # Of a folder that a .pth file adds, Python reads no .pth files: the source tree stays outside.
    (made / "lib" / version / "site-packages" / "dependencies.pth").write_text(
        sysconfig.get_path("purelib") + "\n"
    )
    run(
        folder,
        *(sys.executable, *PIP, "--python", made / "bin" / "python", "install", "--no-deps"),
        *("--no-index", "--ignore-installed", wheel),
    )
    return made / "bin"


def test_every_file_of_the_packages_and_of_the_configuration_is_in_it(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    for folder in (*PACKAGES, "configs"):
        shipped = folder.replace("configs", "robotfleet_configs")
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                assert f"{shipped}/{path.relative_to(ROOT / folder).as_posix()}" in names


def test_a_mission_in_an_empty_folder(tmp_path: Path, installed: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    where = f"import {', '.join(PACKAGES)}; print(*({'.__file__, '.join(PACKAGES)}.__file__,))"
    for file in run(empty, installed / "python", "-c", where).split():
        assert Path(file).is_relative_to(installed.parent)
    told = json.loads(run(empty, installed / "robotctl", "demo", "two-cups", "--json"))
    assert [(goal["physics"], goal["planner"]) for goal in told["goals"]] == [
        ("holds", "reached"),
        ("holds", "reached"),
    ]
    [out] = (empty / "runs").iterdir()
    assert (out / "recording.rrd").stat().st_size > 1000
    assert left_behind(out) == []


def test_a_copy_of_a_mission_needs_nothing_else(tmp_path: Path, installed: Path) -> None:
    empty = tmp_path / "empty"
    own = empty / "configs" / "missions" / "mine.yaml"
    own.parent.mkdir(parents=True)
    shutil.copy(ROOT / "configs" / "missions" / "two-cups.yaml", own)
    for name in PACKAGES:  # a person's own modules of these names are not the packages
        (empty / f"{name}.py").write_text("raise SystemExit('imported from the working folder')")
    told = json.loads(
        run(empty, installed / "robotctl", "demo", "mine", "--backend", "kinematic", "--json")
    )
    assert told["ok"]
