"""The Kubernetes manifests, as far as they can be checked without a cluster."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.oracles.processes import REPOSITORY
from tests.workers.test_deployment import pins
from wingfit.service.http import request_limits
from wingfit.service.settings import Settings

FOLDER = REPOSITORY / "deploy" / "kubernetes"
FILES = sorted(path.name for path in FOLDER.glob("*.yaml") if path.name != "kustomization.yaml")
Json = dict[str, Any]

# Fields of KubeRay 1.6.2, by its API reference: docs/reference/api.md of ray-project/kuberay.
RAY_CLUSTER = {
    "upgradeStrategy", "authOptions", "suspend", "managedBy", "autoscalerOptions", "headServiceAnnotations",
    "enableInTreeAutoscaling", "gcsFaultToleranceOptions", "headGroupSpec", "rayVersion", "workerGroupSpecs",
}  # fmt: skip
GROUP = {"template", "resources", "labels", "rayStartParams"}
HEAD_GROUP = GROUP | {"headService", "enableIngress", "serviceType"}
WORKER_GROUP = GROUP | {
    "suspend", "groupName", "replicas", "minReplicas", "maxReplicas", "idleTimeoutSeconds", "scaleStrategy",
    "numOfHosts",
}  # fmt: skip


def documents(name: str) -> list[Json]:
    return [one for one in yaml.safe_load_all((FOLDER / name).read_text()) if one]


def the(name: str, kind: str) -> Json:
    (found,) = (one for one in documents(name) if one["kind"] == kind)
    return found


def ray_groups() -> list[Json]:
    spec = the("ray-cluster.yaml", "RayCluster")["spec"]
    return [spec["headGroupSpec"], *spec["workerGroupSpecs"]]


def templates() -> Iterator[tuple[str, Json]]:
    """Metadata and specification of every pod."""
    yield "api", the("api.yaml", "Deployment")["spec"]["template"]
    yield "keys", the("keys.yaml", "Pod")
    for group in ray_groups():
        yield group.get("groupName", "head"), group["template"]


PODS = dict(templates())


def container(name: str) -> Json:
    (only,) = PODS[name]["spec"]["containers"]
    found: Json = only
    return found


@pytest.mark.parametrize("name", [name for name in FILES if name != "ray-cluster.yaml"])
def test_kubernetes_knows_every_field(name: str) -> None:
    validator = pytest.importorskip(
        "kubernetes_validate", reason="needs kubernetes-validate (108 MB): pip install -e .[kubernetes]"
    )
    for document in documents(name):
        validator.validate(document, validator.latest_version(), strict=True)


def test_kubernetes_knows_every_field_of_rays_pods() -> None:
    validator = pytest.importorskip(
        "kubernetes_validate", reason="needs kubernetes-validate (108 MB): pip install -e .[kubernetes]"
    )
    for group in ray_groups():
        pod = {"apiVersion": "v1", "kind": "Pod", **group["template"]}
        validator.validate(pod, validator.latest_version(), strict=True)


def test_kuberay_knows_every_field() -> None:
    cluster = the("ray-cluster.yaml", "RayCluster")
    assert cluster["apiVersion"] == "ray.io/v1"
    assert set(cluster["spec"]) <= RAY_CLUSTER
    assert cluster["spec"]["authOptions"] == {"mode": "token"}
    assert set(cluster["spec"]["headGroupSpec"]) <= HEAD_GROUP
    for group in cluster["spec"]["workerGroupSpecs"]:
        assert set(group) <= WORKER_GROUP
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]


def test_ray_knows_every_option_and_is_the_version_of_the_lock() -> None:
    assert the("ray-cluster.yaml", "RayCluster")["spec"]["rayVersion"] == pins()["ray"]
    shown = subprocess.run(
        [Path(sys.executable).with_name("ray"), "start", "--help"], capture_output=True, text=True, check=True
    ).stdout
    for group in ray_groups():
        for name, value in group["rayStartParams"].items():
            assert re.search(rf"--{name}\b", shown), name
            assert isinstance(value, str), f"KubeRay takes texts only: {name}"
    assert ray_groups()[0]["rayStartParams"]["num-cpus"] == "0"


def test_only_one_pod_has_the_data_even_during_an_update() -> None:
    deployment = the("api.yaml", "Deployment")["spec"]
    assert (deployment["replicas"], deployment["strategy"]) == (1, {"type": "Recreate"})
    claim = the("data.yaml", "PersistentVolumeClaim")
    assert claim["spec"]["accessModes"] == ["ReadWriteOncePod"]
    for name in ("api", "keys"):
        volumes = {volume["name"]: volume for volume in PODS[name]["spec"]["volumes"]}
        assert volumes["data"]["persistentVolumeClaim"]["claimName"] == claim["metadata"]["name"]
        assert {"name": "data", "mountPath": "/data"} in container(name)["volumeMounts"]


@pytest.mark.parametrize("name", list(PODS))
def test_no_pod_has_more_rights_than_it_needs(name: str) -> None:
    spec, inner = PODS[name]["spec"], container(name)
    user = re.search(r"useradd --uid (\d+)", (REPOSITORY / "Dockerfile").read_text())
    assert user
    context = spec["securityContext"]
    assert context["runAsNonRoot"] is True
    assert {context["runAsUser"], context["fsGroup"]} == {int(user.group(1))}
    assert context["seccompProfile"] == {"type": "RuntimeDefault"}
    assert spec["automountServiceAccountToken"] is False
    assert inner["securityContext"] == {
        "allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]},
    }  # fmt: skip
    assert "memory" in inner["resources"]["limits"]
    assert "/tmp" in {mount["mountPath"] for mount in inner["volumeMounts"]}  # noqa: S108
    assert all("sizeLimit" in volume["emptyDir"] for volume in spec["volumes"] if "emptyDir" in volume)
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(spec)
    assert not {"privileged"} & set(inner["securityContext"])


def test_a_service_of_this_name_does_not_set_our_settings() -> None:
    """Kubernetes gives pods the variables of links: with a Service wingfit, WINGFIT_PORT=tcp://10.0.0.1:8321."""
    service = the("api.yaml", "Service")["metadata"]["name"]
    link = f"{service.upper().replace('-', '_')}_PORT"
    with pytest.raises(ValueError, match="WINGFIT_PORT is 'tcp://"):
        Settings.from_env({link: "tcp://10.0.0.1:8321"})
    assert all(pod["spec"]["enableServiceLinks"] is False for pod in PODS.values())


def test_the_servers_probes_are_answered_by_any_name() -> None:
    api = container("api")
    paths = {kind: api[f"{kind}Probe"]["httpGet"]["path"] for kind in ("startup", "liveness", "readiness")}
    assert paths == {"startup": "/v1/health", "liveness": "/v1/health", "readiness": "/v1/ready"}
    assert set(paths.values()) <= request_limits.PROBES
    for kind in paths:
        assert api[f"{kind}Probe"]["httpGet"]["port"] == api["ports"][0]["name"]
    patience = api["startupProbe"]["periodSeconds"] * api["startupProbe"]["failureThreshold"]
    assert patience >= 120, "Ray and the migration of a large database take their time"
    assert PODS["api"]["spec"]["terminationGracePeriodSeconds"] >= 60


def test_ray_pods_have_our_own_probes() -> None:
    """KubeRay adds its own where one is missing, which ask a dashboard agent that the image does not have."""
    head = the("ray-cluster.yaml", "RayCluster")["metadata"]["name"] + "-head-svc:6379"
    for name in ("head", "workers"):
        inner = container(name)
        assert {"livenessProbe", "readinessProbe"} <= set(inner)
        assert "wingfit.workers.node_alive" in " ".join(inner["livenessProbe"]["exec"]["command"])
        assert inner["livenessProbe"]["periodSeconds"] >= 30, "each takes half a second of processor time"
    assert container("workers")["livenessProbe"]["exec"]["command"][-1] == head
    assert container("workers")["readinessProbe"]["tcpSocket"]["port"] == int(
        ray_groups()[1]["rayStartParams"]["node-manager-port"]
    )


def test_the_api_joins_with_the_token_that_kuberay_makes() -> None:
    cluster = the("ray-cluster.yaml", "RayCluster")["metadata"]["name"]
    environment = {item["name"]: item["value"] for item in container("api")["env"]}
    assert environment["RAY_AUTH_MODE"] == "token"
    assert environment["WINGFIT_RAY_ADDRESS"] == f"{cluster}-head-svc:6379"
    assert f"--address={cluster}-head-svc:6379 --num-cpus=0" in container("api")["command"][-1]
    (secret,) = (volume["secret"] for volume in PODS["api"]["spec"]["volumes"] if "secret" in volume)
    assert secret == {"secretName": cluster, "defaultMode": 0o440}
    assert environment["RAY_AUTH_TOKEN_PATH"].rpartition("/")[::2] == ("/run/ray-token", "auth_token")
    assert not {"WINGFIT_ALLOW_REMOTE", "RAY_AUTH_TOKEN"} & set(environment), "without keys anybody gets in"


def test_only_members_of_the_cluster_can_reach_ray() -> None:
    ray, api = documents("network-policy.yaml")
    members = {"matchLabels": {"wingfit-ray-member": "yes"}}
    assert ray["spec"]["podSelector"] == members
    assert ray["spec"]["policyTypes"] == ["Ingress", "Egress"]
    assert ray["spec"]["ingress"] == [{"from": [{"podSelector": members}]}]
    to_members, names = ray["spec"]["egress"]
    assert to_members == {"to": [{"podSelector": members}]}
    assert {port["port"] for port in names["ports"]} == {53}
    for name in ("api", "head", "workers"):
        assert PODS[name]["metadata"]["labels"]["wingfit-ray-member"] == "yes"
    # What the second one adds: one port of one pod.
    assert api["spec"]["podSelector"] == {"matchLabels": {"app": "wingfit"}}
    assert "app" not in PODS["head"]["metadata"]["labels"] | PODS["workers"]["metadata"]["labels"]
    assert api["spec"]["ingress"] == [{"ports": [{"protocol": "TCP", "port": 8321}]}]


def test_one_line_names_the_image_of_all_pods(tmp_path: Path) -> None:
    assert {container(name)["image"] for name in PODS} == {"wingfit"}
    kustomization = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())
    assert sorted(kustomization["resources"]) == [name for name in FILES if name != "keys.yaml"]
    if not shutil.which("kubectl"):
        pytest.skip("needs kubectl to see what kustomize makes of it")
    shutil.copytree(FOLDER, tmp_path / "k")
    digest = "sha256:" + "5" * 64
    kustomization["images"] = [{"name": "wingfit", "newName": "registry.example/wingfit", "digest": digest}]
    (tmp_path / "k" / "kustomization.yaml").write_text(yaml.safe_dump(kustomization))
    made = subprocess.run(
        ["kubectl", "kustomize", str(tmp_path / "k")], capture_output=True, text=True, check=True
    ).stdout
    assert re.findall(r"image: (\S+)", made) == [f"registry.example/wingfit@{digest}"] * 3
