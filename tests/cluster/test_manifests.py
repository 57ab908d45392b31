"""Manifests: each is valid by itself, and they agree with each other and with the project."""

from __future__ import annotations

import copy
import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any

import click
import jsonschema
import pytest
import yaml
from pydantic import ValidationError

from .manifests import ClusterSpec, Pod, RayCluster, RayJob

ROOT = Path(__file__).parents[2]
CLUSTER = ROOT / "cluster"
IN_IMAGE = "/opt/pnabs/"
MODELS = {"kuberay-rayjob.yaml": RayJob, "kuberay-raycluster.yaml": RayCluster}
FREE = {"rayStartParams"}
"""Maps whose keys are not ours to know."""


def _yaml(name: str) -> Any:
    return yaml.safe_load((CLUSTER / name).read_text())


@pytest.fixture
def job() -> RayJob:
    return RayJob.model_validate(_yaml("kuberay-rayjob.yaml"))


@pytest.fixture
def cluster(job: RayJob) -> ClusterSpec:
    return job.spec.rayClusterSpec


@pytest.fixture
def ray_version() -> str:
    """The version that the environment is pinned to."""
    pins = (ROOT / ".ci/constraints.txt").read_text()
    return re.findall(r"(?m)^ray==(\S+)$", pins)[0]


@pytest.fixture
def project() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def _keys(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in items:
        if isinstance(node, dict):
            yield (*path, key)
        if isinstance(value, dict | list) and key not in FREE:
            yield from _keys(value, (*path, key))


@pytest.mark.parametrize("name", MODELS)
def test_no_key_can_be_misspelt_unnoticed(name: str) -> None:
    # By way of JSON, for YAML's aliases are one object, and each is to be changed alone.
    text = json.dumps(_yaml(name))
    MODELS[name].model_validate(json.loads(text))
    keys = list(_keys(json.loads(text)))
    assert len(keys) > 50
    for *path, key in keys:
        changed = parent = json.loads(text)
        for step in path:
            parent = parent[step]
        parent[f"{key}x"] = parent.pop(key)
        with pytest.raises(ValidationError):
            MODELS[name].model_validate(changed)


def test_both_manifests_build_the_same_cluster(cluster: ClusterSpec) -> None:
    assert RayCluster.model_validate(_yaml("kuberay-raycluster.yaml")).spec == cluster


def test_one_ray_version_everywhere(
    cluster: ClusterSpec, ray_version: str, project: dict[str, Any]
) -> None:
    assert cluster.rayVersion == ray_version
    images = {pod.containers[0].image for pod in cluster.pods}
    assert images == {f"pnabs:{project['version']}-ray{ray_version}"}
    dockerfile = (CLUSTER / "Dockerfile").read_text()
    assert f"\nARG RAY_VERSION={ray_version}\n" in dockerfile
    assert f"-t {images.pop()} ." in dockerfile
    minor = project["requires-python"].removeprefix(">=").replace(".", "")
    assert f"\nFROM rayproject/ray:${{RAY_VERSION}}-py{minor}-cpu\n" in dockerfile


def test_what_the_image_copies_is_there_and_let_in() -> None:
    text = (CLUSTER / "Dockerfile").read_text()
    copied = [
        source
        for line in re.findall(r"(?m)^COPY (.*)$", text)
        for source in line.split()[:-1]
        if not source.startswith("--")
    ]
    let_in = (CLUSTER / "Dockerfile.dockerignore").read_text().split()
    assert let_in[0] == "*"
    assert sorted(f"!{source}" for source in copied) == sorted(
        line for line in let_in if line.startswith("!")
    )
    assert [source for source in copied if not (ROOT / source).exists()] == []
    # What the build of the package reads lies at the same place in the image.
    assert all(f" {IN_IMAGE}" in line for line in re.findall(r"(?m)^COPY .*$", text))


def test_the_images_user_is_the_pods_user(cluster: ClusterSpec) -> None:
    users = re.findall(r"(?m)^USER (.*)$", (CLUSTER / "Dockerfile").read_text())
    for pod in cluster.pods:
        context = pod.securityContext
        assert users[-1] == f"{context.runAsUser}:{context.runAsGroup}"


def test_pods_get_what_they_ask_for(cluster: ClusterSpec) -> None:
    for pod in cluster.pods:
        resources = pod.containers[0].resources
        assert resources.requests == resources.limits
    for group in cluster.workerGroupSpecs:
        assert group.minReplicas <= group.replicas <= group.maxReplicas


def test_work_stays_off_the_head(cluster: ClusterSpec) -> None:
    assert cluster.headGroupSpec.rayStartParams["num-cpus"] == "0"


def test_clusters_ask_for_a_token(cluster: ClusterSpec) -> None:
    assert cluster.authOptions.mode == "token"


def _mounted(pod: Pod) -> dict[str, tuple[str, bool]]:
    """Mount path -> claim and whether it can be written to."""
    claims = {volume.name: volume.persistentVolumeClaim for volume in pod.volumes}
    return {
        mount.mountPath: (
            claims[mount.name].claimName,
            not (mount.readOnly or claims[mount.name].readOnly),
        )
        for mount in pod.containers[0].volumeMounts
    }


def _entrypoint(job: RayJob) -> list[str]:
    return shlex.split(job.spec.entrypoint)


def _option(words: list[str], name: str, start: str = "") -> str:
    values = [value for option, value in pairwise(words) if option == name]
    return next(value for value in values if value.startswith(start)).removeprefix(start)


def test_all_pods_share_the_run_folder_and_the_dataset(job: RayJob, cluster: ClusterSpec) -> None:
    mounted = [_mounted(pod) for pod in cluster.pods]
    assert all(mounts == mounted[0] for mounts in mounted)
    words = _entrypoint(job)
    out = PurePosixPath(_option(words, "--out"))
    root = PurePosixPath(_option(words, "--set", "dataset.root="))
    for mounts in mounted:
        assert [mounts[m][1] for m in mounts if out.is_relative_to(m)] == [True]
        assert [mounts[m][1] for m in mounts if root.is_relative_to(m)] == [False]
    readme = (CLUSTER / "README.md").read_text()
    assert all(f"`{claim}`" in readme for claim, _ in mounted[0].values())


def _parse(words: list[str]) -> click.Context:
    """Parse a command line without running it; paths in the image are those of the checkout."""
    from pnabs.cli import main

    local = [word.replace(IN_IMAGE, f"{ROOT}/") for word in words]
    assert local[0] == "pnabs"
    assert isinstance(main, click.Group)
    return main.commands[local[1]].make_context(local[1], local[2:])


def test_the_entrypoint_parses(job: RayJob) -> None:
    assert _parse(_entrypoint(job)).params["address"] == "auto"


def test_the_entrypoints_job_is_valid_with_its_overrides(job: RayJob) -> None:
    from pnabs.stages.job import load_job

    words = _entrypoint(job)
    path = words[2]
    assert path.startswith(IN_IMAGE)
    overrides = [value for option, value in pairwise(words) if option == "--set"]
    loaded = load_job(ROOT / path.removeprefix(IN_IMAGE), overrides, Path(_option(words, "--out")))
    assert loaded.settings.dataset.root == Path("/data/ShapeNetCore.v2")


def test_the_readmes_commands_parse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"(?s)```sh\n(.*?)```", (CLUSTER / "README.md").read_text())
    commands = [line for block in blocks for line in block.splitlines()]
    ours = [shlex.split(line) for line in commands if line.startswith("pnabs ")]
    assert len(ours) >= 2
    for words in ours:
        _parse(words)
    files = {word for line in commands for word in line.split() if word.startswith("cluster/")}
    assert files == {f"cluster/{name}" for name in ("Dockerfile", "onprem.yaml", *MODELS)}
    assert all((ROOT / file).is_file() for file in files)


def test_the_readme_builds_the_manifests_image(cluster: ClusterSpec) -> None:
    image = cluster.pods[0].containers[0].image
    assert f"-t {image} ." in (CLUSTER / "README.md").read_text()


def _launcher_config(config: dict[str, Any]) -> dict[str, Any]:
    """The launcher's own preparation and validation; needs no machine and no network."""
    from ray.autoscaler._private.util import prepare_config, validate_config

    prepared: dict[str, Any] = prepare_config(copy.deepcopy(config))
    validate_config(prepared)
    return prepared


def test_the_launcher_accepts_the_on_premise_file() -> None:
    config = _yaml("onprem.yaml")
    prepared = _launcher_config(config)
    assert prepared["max_workers"] == len(config["provider"]["worker_ips"])
    with pytest.raises(jsonschema.ValidationError, match="setup_comands"):
        _launcher_config(config | {"setup_comands": []})


@pytest.mark.parametrize("node", ["head", "worker"])
def test_on_premise_nodes_start_with_the_token_and_the_pinned_environment(node: str) -> None:
    config = _yaml("onprem.yaml")
    stop, start = (shlex.split(line) for line in config[f"{node}_start_ray_commands"])
    checkout = next(remote for remote, local in config["file_mounts"].items() if local == ".")
    ray = f"{checkout}/.venv/bin/ray"
    assert stop == [ray, "stop"]
    assert start[:4] == ["RAY_AUTH_MODE=token", "RAY_USAGE_STATS_ENABLED=0", ray, "start"]
    assert config["file_mounts"]["~/.ray/auth_token"] == "~/.ray/auth_token"
    assert f"make -C {checkout} setup" in config["setup_commands"]

    from ray.scripts.scripts import start as ray_start

    known = {name for option in ray_start.params for name in option.opts}
    given = {word.partition("=")[0] for word in start[4:]}
    assert given <= known
