"""The files under deploy/ agree with each other and with robotctl; no engine is needed for that."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from cli.certificates.identity import Identity, Kind
from cli.deployment.launch import CONFIG
from cli.settings import endpoints
from tests.support.command_lines import parse

ROOT = Path(__file__).parents[3]
DEPLOY = ROOT / "deploy"
KUSTOMIZATIONS = [DEPLOY / "kubernetes" / name for name in ("base", "two-cups")]
WITH_CERTIFICATES = DEPLOY / "kubernetes" / "two-cups-certificates"
COMPOSE = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
SECURE = yaml.safe_load((DEPLOY / "compose.certificates.yaml").read_text(encoding="utf-8"))
COMPONENT = yaml.safe_load(
    (DEPLOY / "kubernetes" / "certificates" / "kustomization.yaml").read_text(encoding="utf-8")
)
CONTAINERFILE = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
USER = 10001


def stages() -> dict[str, str]:
    """What stands in each target of the Containerfile."""
    pieces = re.split(r"^FROM \S+ AS (\w+)$", CONTAINERFILE, flags=re.MULTILINE)
    return dict(zip(pieces[1::2], pieces[2::2], strict=True))


def written(stage: str, instruction: str) -> list[str]:
    """The words of an instruction's exec form."""
    found = re.search(rf"^{instruction}.*?(\[.*\])$", stage, re.MULTILINE)
    assert found is not None, instruction
    words = yaml.safe_load(found[1])
    assert isinstance(words, list)
    return words


def resources(folder: Path) -> Iterator[dict[str, Any]]:
    """What a kustomization names, as it stands in the files."""
    listed = yaml.safe_load((folder / "kustomization.yaml").read_text(encoding="utf-8"))
    for name in listed["resources"]:
        path = folder / name
        if path.is_dir():
            yield from resources(path)
        else:
            yield from yaml.safe_load_all(path.read_text(encoding="utf-8"))


MANIFESTS = list(resources(KUSTOMIZATIONS[-1]))
PODS = {
    each["metadata"]["name"]: (each, each["spec"]["template"]["spec"])
    for each in MANIFESTS
    if "template" in each.get("spec", {})
}
PROBES = ("startupProbe", "readinessProbe", "livenessProbe")


def test_each_image_starts_and_asks_for_health_by_commands_that_there_are() -> None:
    found = stages()
    assert set(found) == {
        "libraries",
        "build",
        "robotfleet",
        "router",
        "planner",
        "worker",
        "recorder",
        "sim",
    }
    assert written(found["robotfleet"], "ENTRYPOINT") == ["robotctl"]
    assert f"USER {USER}:{USER}" in found["robotfleet"]
    for role in set(found) - {"libraries", "build", "robotfleet"}:
        parse(written(found[role], "CMD"))
        asked = written(found[role], "HEALTHCHECK")
        assert asked == ["robotctl", "health", role]
        parse(asked[1:])


def test_the_image_takes_the_locked_versions_from_wherever_the_builder_finds_them() -> None:
    assert "--require-hashes --requirement requirements.lock" in stages()["libraries"].replace(
        "\\\n    ", ""
    )
    assert re.search(r"^ARG BASE=", CONTAINERFILE, re.MULTILINE)
    for text in (CONTAINERFILE, (DEPLOY / "compose.yaml").read_text(encoding="utf-8")):
        assert "://" not in text
    allowed = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    for line in allowed:
        if line.startswith("!"):
            assert (ROOT / line[1:]).exists(), line


def test_services_agree_with_images_ports_and_volumes() -> None:
    assert set(COMPOSE["services"]) == {
        *("router", "planner", "recorder", "sim"),
        *("worker-hsr", "worker-locobot", "robots", "world"),
    }
    used = set()
    for name, service in COMPOSE["services"].items():
        parse([str(word) for word in service["command"]])
        assert service["image"] == "robotfleet"
        assert ("build" in service) is (name == "router")  # once for all
        role = name.partition("-")[0]
        assert (service["read_only"], service["cap_drop"]) == (True, ["ALL"])
        assert "no-new-privileges:true" in service["security_opt"]
        assert not {"privileged", "user"} & service.keys()
        (volume,) = service["volumes"]
        source, target = volume.split(":")
        assert target == "/data"
        used.add(source)
        (router,) = endpoints(service["environment"]["ROBOTFLEET_ROUTER"], name)
        assert router == ("tcp/127.0.0.1:7447" if name == "router" else "tcp/router:7447")
        if "test" in service["healthcheck"]:
            shell, program, *words = service["healthcheck"]["test"]
            assert (shell, program, words[:2]) == ("CMD", "robotctl", ["health", role])
            parse(words)
        else:
            assert service["restart"] == "on-failure"
    assert used == set(COMPOSE["volumes"])
    assert COMPOSE["services"]["router"]["build"]["target"] in stages()
    assert COMPOSE["services"]["router"]["ports"] == ["127.0.0.1:7447:7447"]


def test_pods_have_no_privilege_and_probes_that_there_are() -> None:
    assert set(PODS) == {
        *("router", "planner", "recorder", "sim"),
        *("worker-hsr", "worker-locobot", "robots", "world"),
    }
    for name, (workload, pod) in PODS.items():
        (container,) = pod["containers"]
        assert pod["securityContext"]["runAsNonRoot"] is True, name
        assert pod["securityContext"]["runAsUser"] == pod["securityContext"]["fsGroup"] == USER
        assert pod["automountServiceAccountToken"] is False
        assert container["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }
        parse(container["args"])
        service = COMPOSE["services"][name]
        role = "worker" if workload["kind"] == "Job" else name.partition("-")[0]
        assert container["image"] == f"robotfleet-{role}"
        assert role in stages()
        assert container["args"] == [str(word) for word in service["command"]]
        for probe in PROBES:
            if probe in container:
                program, *words = container[probe]["exec"]["command"]
                assert program == "robotctl"
                parse(words)
                assert ("--live" in words) is (probe == "livenessProbe")
                assert [w for w in words if w != "--live"] == service["healthcheck"]["test"][2:]
        if workload["kind"] != "Job":
            assert set(PROBES[:2]) <= container.keys(), name
        labels = workload["spec"]["template"]["metadata"]["labels"]
        if "selector" in workload["spec"]:
            assert workload["spec"]["selector"]["matchLabels"].items() <= labels.items()
        there = {each["name"] for each in pod["volumes"]} | {
            each["metadata"]["name"] for each in workload["spec"].get("volumeClaimTemplates", ())
        }
        assert {each["name"]: each["mountPath"] for each in container["volumeMounts"]} == {
            "data": "/data",
            "tmp": "/tmp",
        }
        assert there == {"data", "tmp"}


def test_pods_find_the_router_that_the_service_stands_for() -> None:
    (service,) = (each for each in MANIFESTS if each["kind"] == "Service")
    workload, pod = PODS["router"]
    labels = workload["spec"]["template"]["metadata"]["labels"]
    assert service["spec"]["selector"].items() <= labels.items()
    (port,) = service["spec"]["ports"]
    (listens,) = pod["containers"][0]["ports"]
    assert (port["targetPort"], port["port"]) == (listens["name"], listens["containerPort"])
    assert pod["containers"][0]["args"][-1] == f"tcp/0.0.0.0:{listens['containerPort']}"
    kustomization = yaml.safe_load((KUSTOMIZATIONS[0] / "kustomization.yaml").read_text())
    (generated,) = kustomization["configMapGenerator"]
    literals = dict(each.split("=", 1) for each in generated["literals"])
    assert literals["ROBOTFLEET_ROUTER"] == f"tcp/{service['metadata']['name']}:{port['port']}"
    for name, (_, each) in PODS.items():
        (container,) = each["containers"]
        assert container["envFrom"] == [{"configMapRef": {"name": generated["name"]}}], name
    renamed = {each["name"] for each in kustomization["images"]}
    assert renamed | {"robotfleet-sim"} == {
        each["containers"][0]["image"] for _, each in PODS.values()
    }


def test_with_certificates_each_service_has_its_own_files_and_nobody_the_authority() -> None:
    assert set(SECURE["services"]) == set(COMPOSE["services"])
    for name, service in SECURE["services"].items():
        (mounted,) = service["volumes"]
        source, target, mode = mounted.rsplit(":", 2)
        who = source.rpartition("/")[2]
        assert (target, mode) == (CONFIG, "ro")
        said = service["environment"]
        assert said["ROBOTFLEET_ZENOH_CONFIG"] == f"{CONFIG}/{who}.json5"
        (router,) = endpoints(said["ROBOTFLEET_ROUTER"], name)
        assert router == ("tls/localhost:7447" if name == "router" else "tls/router:7447")
        kind, _, own = who.partition("-")
        identity = Identity(Kind(kind), own)
        expected = "operator" if name in ("robots", "world") else name.partition("-")[0]
        assert identity.kind.value == expected.replace("worker", "robot")
        if identity.kind is Kind.ROBOT:
            assert own in COMPOSE["services"][name]["command"]
        assert service.keys() - {"command"} == {"environment", "volumes"}
    assert SECURE["services"]["router"]["command"] == ["router"]


def test_with_certificates_each_workload_has_a_secret_and_all_speak_tls() -> None:
    for_all, router, *secrets = COMPONENT["patches"]
    (mount,) = yaml.safe_load(for_all["patch"])
    assert mount["value"] == {"name": "certificates", "mountPath": CONFIG, "readOnly": True}
    assert {each["kind"] for each, _ in PODS.values()} == set(for_all["target"]["kind"].split("|"))
    (generated,) = COMPONENT["configMapGenerator"]
    literals = dict(each.split("=", 1) for each in generated["literals"])
    assert literals["ROBOTFLEET_ROUTER"] == "tls/router:7447"
    assert literals["ROBOTFLEET_ZENOH_CONFIG"] == f"{CONFIG}/zenoh.json5"
    arguments, probed = yaml.safe_load(router["patch"])
    assert (arguments["value"], probed["value"]) == (["router"], "tls/localhost:7447")
    found = {}
    for patch in secrets:
        (added,) = yaml.safe_load(patch["patch"])
        name = patch["target"]["name"]
        assert patch["target"]["kind"] == PODS[name][0]["kind"]
        secret = added["value"]["secret"]
        assert secret["defaultMode"] == 0o440
        found[name] = secret["secretName"]
    setup = {"robots": "setup", "world": "setup"}
    assert found == {name: f"{setup.get(name, name)}-certificate" for name in PODS}


@pytest.mark.parametrize(
    "folder", [*KUSTOMIZATIONS, WITH_CERTIFICATES], ids=lambda folder: str(folder.name)
)
def test_kubernetes_own_tools_take_it(folder: Path) -> None:
    if (kubectl := shutil.which("kubectl")) is None:
        pytest.skip("kubectl is not on the path: the manifests were not put together by it")
    made = subprocess.run([kubectl, "kustomize", str(folder)], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    whole = list(yaml.safe_load_all(made.stdout))
    # What is generated has a name of its own, and the namespace has none.
    assert len(whole) == len(list(resources(folder))) + 1
    if folder.name == "two-cups-certificates":
        for each in whole:
            if each["metadata"]["name"] in PODS and "template" in each["spec"]:
                pod = each["spec"]["template"]["spec"]
                volumes = {volume["name"] for volume in pod["volumes"]}
                (container,) = pod["containers"]
                mounts = {mount["name"] for mount in container["volumeMounts"]}
                assert "certificates" in volumes & mounts


def test_manifests_are_what_kubernetes_own_schemas_say() -> None:
    if (checker := shutil.which("kubeconform")) is None:
        pytest.skip("kubeconform is not on the path: schemas were not checked")
    told = yaml.safe_dump_all(MANIFESTS)
    checked = subprocess.run([checker, "-strict", "-"], input=told, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout


def test_compose_own_tool_takes_it() -> None:
    if (tool := shutil.which("podman-compose")) is None:
        pytest.skip("podman-compose is not on the path: it was not asked about compose.yaml")
    usage = subprocess.run([tool, "--help"], capture_output=True, text=True).stdout
    if not re.search(r"\bconfig\b", usage):
        pytest.skip("podman-compose has no `config`, as 1.0.3 of Debian 12: it was not asked")
    files = ("--file", str(DEPLOY / "compose.yaml"))
    more = ("--file", str(DEPLOY / "compose.certificates.yaml"))
    for named in (files, (*files, *more)):
        told = subprocess.run([tool, *named, "config"], capture_output=True, text=True)
        assert told.returncode == 0, told.stderr
