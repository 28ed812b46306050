"""What `robotctl deploy` would run, and what it says where that cannot be."""

from __future__ import annotations

import asyncio
import json
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from cli.commands.deploy import deploy
from cli.deployment.engines import Step, Target
from cli.deployment.kubernetes import manifest
from cli.deployment.launch import Launch, container_name, launch
from cli.deployment.running import run
from cli.errors import BadArgument, NotDeployed
from keyexpr_schema.ids import ID_PATTERN
from keyexpr_schema.payloads.deployments import Engine
from sim.errors import BadFile
from sim.files.deployment_schema import DeploymentEntry
from sim.files.robot_file import load_deployment, load_robot

HSR = (Path(__file__).parents[3] / "configs" / "robots" / "hsr.yaml").read_text(encoding="utf-8")
ROUTER = "tcp/site:7447"
NASTY = "it's $(touch pwned) `id` \"; rm -rf / #"
NAMES = st.from_regex(ID_PATTERN.replace("$", r"\Z"), fullmatch=True)


def robot_file(folder: Path, deployment: str) -> Path:
    file = folder / "own.yaml"
    file.write_text(f"{HSR}\ndeployment:\n{deployment}", encoding="utf-8")
    return file


def launched(entry: DeploymentEntry, *, said: bool = True) -> Launch:
    return launch("hsr", entry, [ROUTER], "lab", said=said)


def words(step: Step, option: str) -> list[str]:
    """What follows each of an option in a command."""
    return [b for a, b in zip(step.argv, step.argv[1:], strict=False) if a == option]


def test_a_file_says_how_its_worker_is_deployed(tmp_path: Path) -> None:
    file = robot_file(
        tmp_path,
        """
  image: lab/worker:2
  host: ana@lab-3
  command: [worker, "{robot}", --embodiment, arm]
  environment: {ROBOT_IP: 10.0.0.7}
  devices: [/dev/ttyUSB0, "/dev/video0:/dev/video1:rw"]
  zenoh_config: /etc/fleet/robot-hsr.json5
""",
    )
    spec, entry = load_deployment(file)
    assert spec == load_robot("hsr")  # what is registered says nothing of it
    step = Target(Engine.PODMAN).start(launch("hsr_2", entry, [ROUTER], "lab", said=False))
    assert words(step, "--device") == list(entry.devices)
    assert words(step, "--env") == [
        "ROBOTFLEET_REALM=lab",
        "ROBOTFLEET_ZENOH_CONFIG=/etc/robotfleet/robot-hsr.json5",
        "ROBOT_IP=10.0.0.7",
    ]
    assert "/etc/fleet:/etc/robotfleet:ro" in words(step, "--volume")
    assert step.argv[-5:] == ("lab/worker:2", "worker", "hsr_2", "--embodiment", "arm")


def test_a_file_that_says_nothing_will_do() -> None:
    step = Target(Engine.DOCKER).start(launched(load_deployment("hsr")[1]))
    assert step.argv[:3] == ("docker", "run", "--detach")
    assert step.argv[-3:] == ("robotfleet-worker", "worker", "hsr")
    assert words(step, "--env") == ["ROBOTFLEET_REALM=lab", f"ROBOTFLEET_ROUTER={ROUTER}"]
    for option in ("--read-only", "no-new-privileges", "ALL"):
        assert option in step.argv
    assert "--privileged" not in step.argv


@pytest.mark.parametrize(
    ("deployment", "sentence"),
    [
        (
            "  image: --privileged",
            "line .*deployment.image: '--privileged' is not the name of an",
        ),
        ("  host: -oProxyCommand=id", "deployment.host: .* is not a host as ssh takes it"),
        ("  devices: [ttyUSB0]", r"deployment.devices\[0\]: 'ttyUSB0' is not a device"),
        ("  environment: {1A: x}", "deployment.environment.1A: '1A' is not the name of a variable"),
        ("  environment: {A: 1}", "deployment.environment.A: .*put it in quotes"),
        ("  zenoh_config: robot.json5", "deployment.zenoh_config: .*whole path of a .json5 file"),
        ("  command: []", "deployment.command: it is empty"),
        ("  imag: x", "deployment: there is no field `imag`"),
    ],
)
def test_what_cannot_be_meant_is_said_where_it_stands(
    tmp_path: Path, deployment: str, sentence: str
) -> None:
    with pytest.raises(BadFile) as refused:
        load_deployment(robot_file(tmp_path, deployment))
    assert re.search(sentence, str(refused.value)), refused.value


def test_nothing_is_left_to_a_shell_on_the_other_host(tmp_path: Path) -> None:
    entry = DeploymentEntry(environment={"WORDS": NASTY}, command=("do", NASTY))
    here = Target(Engine.PODMAN).start(launched(entry))
    there = Target(Engine.PODMAN, "ana@lab-3").start(launched(entry))
    assert there.argv[-3:-1] == ("--", "ana@lab-3")
    # A program of that name that tells, on lines of their own, the words that it was given.
    podman = tmp_path / "podman"
    podman.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    podman.chmod(0o755)
    told = subprocess.run(
        ["/bin/sh", "-c", there.argv[-1]],
        env={"PATH": f"{tmp_path}:/usr/bin:/bin"},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.splitlines() == list(here.argv[1:])
    assert list(tmp_path.iterdir()) == [podman]
    # And what a person pastes is the same command.
    assert shlex.split(str(here)) == list(here.argv)


def test_a_cluster_runs_it_without_privilege() -> None:
    entry = DeploymentEntry(zenoh_config="/certs/robot-hsr.json5", environment={"A": "b"})
    workload = json.loads(manifest(launched(entry), "node-1"))
    pod = workload["spec"]["template"]["spec"]
    (container,) = pod["containers"]
    assert pod["nodeSelector"] == {"kubernetes.io/hostname": "node-1"}
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert container["securityContext"]["readOnlyRootFilesystem"] is True
    assert {"name": "A", "value": "b"} in container["env"]
    # The certificates are a secret that is mounted, and nothing of it is written here.
    assert {m["mountPath"] for m in container["volumeMounts"]} == {
        "/data",
        "/tmp",
        "/etc/robotfleet",
    }
    assert workload["metadata"]["name"] == "lab-hsr-worker"
    with pytest.raises(BadArgument, match="a pod without privilege has no devices"):
        manifest(launched(DeploymentEntry(devices=("/dev/ttyUSB0",))))


@given(st.tuples(NAMES, NAMES), st.tuples(NAMES, NAMES))
def test_two_robots_never_have_containers_of_one_name(
    one: tuple[str, str], other: tuple[str, str]
) -> None:
    names = [container_name(robot, realm) for realm, robot in (one, other)]
    assert (names[0] == names[1]) is (one == other)
    for name in names:
        assert re.fullmatch(r"[a-z0-9]([a-z0-9-]{0,50}[a-z0-9])?", name), name


def dry_run(*arguments: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(deploy, [*arguments, "--dry-run"])
    return done.exit_code, done.stdout, done.stderr


def test_a_dry_run_prints_the_command_and_needs_no_fleet(tmp_path: Path) -> None:
    file = robot_file(tmp_path, "  host: lab-3")
    code, out, err = dry_run(str(file), "--router", ROUTER)
    assert (code, err) == (0, "")
    assert out.startswith("ssh -o BatchMode=yes -o ConnectTimeout=10 -- lab-3 'podman run ")
    code, out, _ = dry_run(str(file), "--router", ROUTER, "--on", "docker", "--as", "hsr_9")
    assert out.startswith("docker run --detach --name robotfleet-hsr-9-")
    code, out, _ = dry_run(str(file), "lab-4", "--router", ROUTER, "--on", "kubernetes")
    assert '"kubernetes.io/hostname": "lab-4"' in out


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--on", "podmn"], "did you mean 'podman'?"),
        (["--on", "ssh"], "--on ssh: name the host"),
        (["--on", "ssh", "--", "-oX"], "'-oX' is not a host"),
        (["--on", "ssh", "lab-3"], "is the loopback of this machine"),
        (["--on", "kubernetes"], "is the loopback of this machine"),
    ],
)
def test_where_it_cannot_be_deployed_is_a_sentence(arguments: list[str], sentence: str) -> None:
    here = ("--dry-run", "--router", "tcp/127.0.0.1:1")
    done = CliRunner().invoke(deploy, [*here, "hsr", *arguments])
    assert (done.exit_code, done.stdout) == (1, "")
    assert sentence in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "about_help", ["See 'docker run --help'.", "Run 'docker run --help' for more information"]
)
def test_what_docker_says_of_its_help_is_not_what_was_wrong(about_help: str) -> None:
    wrong = "docker: Cannot connect to the Docker daemon at unix:///run/docker.sock."
    said = Step(("printf", "%s\n\n", wrong, about_help))
    assert asyncio.run(run(said, Target(Engine.DOCKER))).said == wrong
    assert asyncio.run(run(Step(said.argv[:2]), Target(Engine.DOCKER))).said == ""


def test_no_engine_and_no_host_are_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ssh = shutil.which("ssh")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NotDeployed, match="there is no podman on this machine: install it"):
        asyncio.run(run(Step(("podman", "ps")), Target(Engine.PODMAN)))
    if ssh is None:
        pytest.skip("ssh is not on the path: a host that cannot be reached was not tried")
    (tmp_path / "ssh").symlink_to(ssh)
    nobody = Target(Engine.PODMAN, "nobody.invalid")
    with pytest.raises(NotDeployed, match=r"nobody\.invalid cannot be reached over ssh: "):
        asyncio.run(run(nobody.has_container("x"), nobody))
