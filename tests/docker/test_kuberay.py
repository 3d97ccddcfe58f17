"""The manifests for KubeRay: their fields are known ones, and they say what this LMTR needs."""

import json
from pathlib import Path

import jsonschema
import pytest
import ray
import yaml

from services.cluster.ray_cluster import HEALTH
from services.cluster.worker import SINGLE_THREADED

FOLDER = Path(__file__).parents[2] / "docker" / "kuberay"


@pytest.fixture
def cluster():
    return yaml.safe_load((FOLDER / "raycluster.yaml").read_text(encoding="utf-8"))


@pytest.fixture
def job():
    return yaml.safe_load((FOLDER / "generate.yaml").read_text(encoding="utf-8"))


def check(cluster):
    schema = json.loads((FOLDER / "schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(cluster)


def pods(cluster):
    spec = cluster["spec"]
    groups = [spec["headGroupSpec"], *spec["workerGroupSpecs"]]
    return [group["template"]["spec"] for group in groups]


def environment(pod):
    return {entry["name"]: entry.get("value") for entry in pod["containers"][0]["env"]}


def test_only_known_fields_of_the_right_types_are_used(cluster):
    check(cluster)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("replica",), 4),
        (("replicas",), "4"),
        (("rayStartParams", "num-cpus"), 8),
        (("template", "spec", "containers"), []),
    ],
)
def test_a_field_that_is_misspelt_or_of_the_wrong_type_is_found(cluster, path, value):
    node = cluster["spec"]["workerGroupSpecs"][0]
    for name in path[:-1]:
        node = node[name]
    node[path[-1]] = value
    with pytest.raises(jsonschema.ValidationError):
        check(cluster)


def test_every_node_has_the_settings_that_every_process_must_have(cluster):
    for pod in pods(cluster):
        variables = environment(pod)
        assert HEALTH.items() <= variables.items()
        assert variables["RAY_AUTH_MODE"] == "token"
        assert "RAY_AUTH_TOKEN" in variables
        assert set(variables) & set(SINGLE_THREADED)
        assert all(variables[name] == "1" for name in set(variables) & set(SINGLE_THREADED))


def test_every_mount_has_its_volume_and_shared_memory_is_memory(cluster):
    for pod in pods(cluster):
        volumes = {volume["name"]: volume["emptyDir"] for volume in pod["volumes"]}
        mounts = {m["mountPath"]: m["name"] for m in pod["containers"][0]["volumeMounts"]}
        assert set(mounts.values()) == set(volumes)
        assert volumes[mounts["/dev/shm"]]["medium"] == "Memory"


def test_a_pod_offers_as_many_solvers_as_it_has_processors(cluster):
    for group in cluster["spec"]["workerGroupSpecs"]:
        resources = group["template"]["spec"]["containers"][0]["resources"]
        assert group["rayStartParams"]["num-cpus"] == resources["limits"]["cpu"]


def test_no_pod_has_rights_that_it_does_not_need(cluster, job):
    for pod in (job["spec"]["template"]["spec"], *pods(cluster)):
        # What the "restricted" level of Kubernetes' pod security standards asks for.
        assert pod["securityContext"] == {
            "runAsNonRoot": True,
            "seccompProfile": {"type": "RuntimeDefault"},
        }
        assert pod["containers"][0]["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "capabilities": {"drop": ["ALL"]},
        }


def test_the_version_of_ray_is_the_one_that_is_installed(cluster):
    assert cluster["spec"]["rayVersion"] == ray.__version__


def test_the_job_submits_to_the_head_with_the_cluster_s_token(cluster, job):
    pod = job["spec"]["template"]["spec"]
    variables = environment(pod)
    assert variables["RAY_ADDRESS"] == f"http://{cluster['metadata']['name']}-head-svc:8265"
    tokens = [
        entry["valueFrom"]
        for each in (pod, *pods(cluster))
        for entry in each["containers"][0]["env"]
        if entry["name"] == "RAY_AUTH_TOKEN"
    ]
    assert tokens == [tokens[0]] * len(tokens)
