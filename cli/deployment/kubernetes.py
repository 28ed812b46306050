"""A robot's worker as a workload of Kubernetes, like those of `deploy/kubernetes`: unprivileged."""

from __future__ import annotations

import json
from typing import Any

from cli.deployment.launch import CONFIG, DATA, Launch
from cli.errors import BadArgument

_USER = 10001
"""As in deploy/Containerfile."""


def manifest(launch: Launch, node: str | None = None) -> str:
    """JSON for `kubectl apply`; `node`: the host on which it must run.

    A StatefulSet of one: the next pod never begins before the last has ended, and has its volume.
    Certificates are a secret of the container's name, which somebody has made.

    Raises:
        BadArgument: it has devices, which a pod gets by privilege or by a plug-in of the cluster.
    """
    if launch.devices:
        raise BadArgument(
            f"{launch.robot} needs {', '.join(launch.devices)}, and a pod without privilege has no "
            "devices: deploy it on its host, with --on ssh HOST, or add your device plug-in's "
            "resource to what --dry-run prints"
        )
    secret = launch.certificates is not None
    mounts = [("data", DATA, False), ("tmp", "/tmp", False)]
    volumes: list[dict[str, Any]] = [{"name": "tmp", "emptyDir": {}}]
    if secret:
        mounts.append(("certificates", CONFIG, True))
        volumes.append(
            {
                "name": "certificates",
                "secret": {"secretName": launch.name, "defaultMode": 0o440},
            }
        )
    container = {
        "name": "worker",
        "image": launch.image,
        "imagePullPolicy": "IfNotPresent",
        "args": list(launch.arguments),
        "env": [{"name": name, "value": value} for name, value in launch.environment.items()],
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        },
        "startupProbe": _probe(launch, 5, 60),
        "readinessProbe": _probe(launch, 30, 3),
        "livenessProbe": _probe(launch, 30, 4, "--live"),
        "volumeMounts": [
            {"name": name, "mountPath": path, **({"readOnly": True} if fixed else {})}
            for name, path, fixed in mounts
        ],
    }
    pod = {
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        **({"nodeSelector": {"kubernetes.io/hostname": node}} if node else {}),
        "securityContext": {
            "runAsNonRoot": True,
            "runAsUser": _USER,
            "runAsGroup": _USER,
            "fsGroup": _USER,
            "seccompProfile": {"type": "RuntimeDefault"},
        },
        "containers": [container],
        "volumes": volumes,
    }
    own = {"app.kubernetes.io/name": launch.name}
    labels = {
        **own,
        "app.kubernetes.io/component": "worker",
        "app.kubernetes.io/part-of": "robotfleet",
    }
    claim = {"accessModes": ["ReadWriteOnce"], "resources": {"requests": {"storage": "1Gi"}}}
    workload = {
        "apiVersion": "apps/v1",
        "kind": "StatefulSet",
        "metadata": {"name": launch.name, "labels": labels},
        "spec": {
            "serviceName": launch.name,
            "replicas": 1,
            "selector": {"matchLabels": own},
            "template": {"metadata": {"labels": dict(labels)}, "spec": pod},
            "volumeClaimTemplates": [{"metadata": {"name": "data"}, "spec": claim}],
        },
    }
    return f"{json.dumps(workload, indent=2, ensure_ascii=False)}\n"


def _probe(launch: Launch, every_s: int, failures: int, *flags: str) -> dict[str, Any]:
    return {
        "exec": {"command": [*launch.health, *flags]},
        "timeoutSeconds": 6,
        "periodSeconds": every_s,
        "failureThreshold": failures,
    }
