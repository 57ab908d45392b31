"""The fields that the manifests use, strictly: a misspelt key is an error here.

Kubernetes drops fields that it doesn't know without a word, so a typing mistake would show as
behaviour only.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PositiveInt

Name = Annotated[str, Field(pattern=r"^[a-z0-9]([-a-z0-9]*[a-z0-9])?$", max_length=63)]
Cpu = Annotated[str, Field(pattern=r"^[1-9][0-9]*$")]
Memory = Annotated[str, Field(pattern=r"^[1-9][0-9]*(Mi|Gi)$")]
MountPath = Annotated[str, Field(pattern=r"^(/[a-z0-9-]+)+$")]


class Strict(BaseModel):
    """No unknown keys, and no number where a string is meant."""

    model_config = ConfigDict(extra="forbid", strict=True)


class Metadata(Strict):
    name: Name


class SecurityContext(Strict):
    runAsNonRoot: Literal[True]
    runAsUser: PositiveInt
    runAsGroup: PositiveInt
    fsGroup: PositiveInt


class Port(Strict):
    name: Name
    containerPort: Annotated[int, Field(gt=0, lt=65536)]


class Quantities(Strict):
    cpu: Cpu
    memory: Memory


class Resources(Strict):
    requests: Quantities
    limits: Quantities


class Mount(Strict):
    name: Name
    mountPath: MountPath
    readOnly: bool = False


class Container(Strict):
    name: Name
    image: str
    ports: list[Port] = []
    resources: Resources
    volumeMounts: list[Mount]


class Claim(Strict):
    claimName: Name
    readOnly: bool = False


class Volume(Strict):
    name: Name
    persistentVolumeClaim: Claim


class Pod(Strict):
    securityContext: SecurityContext
    containers: Annotated[list[Container], Field(min_length=1, max_length=1)]
    volumes: list[Volume]


class Template(Strict):
    spec: Pod


class HeadGroup(Strict):
    rayStartParams: dict[str, str]
    template: Template


class WorkerGroup(Strict):
    groupName: Name
    replicas: PositiveInt
    minReplicas: PositiveInt
    maxReplicas: PositiveInt
    rayStartParams: dict[str, str]
    template: Template


class AuthOptions(Strict):
    mode: Literal["token", "disabled"]


class ClusterSpec(Strict):
    rayVersion: str
    authOptions: AuthOptions
    headGroupSpec: HeadGroup
    workerGroupSpecs: Annotated[list[WorkerGroup], Field(min_length=1)]

    @property
    def pods(self) -> list[Pod]:
        """The pod of the head, then that of each worker group."""
        groups = [self.headGroupSpec, *self.workerGroupSpecs]
        return [group.template.spec for group in groups]


class JobSpec(Strict):
    entrypoint: str
    submissionMode: Literal["K8sJobMode", "HTTPMode", "SidecarMode"]
    backoffLimit: Annotated[int, Field(ge=0)]
    shutdownAfterJobFinishes: bool
    ttlSecondsAfterFinished: PositiveInt
    rayClusterSpec: ClusterSpec


class RayJob(Strict):
    apiVersion: Literal["ray.io/v1"]
    kind: Literal["RayJob"]
    metadata: Metadata
    spec: JobSpec


class RayCluster(Strict):
    apiVersion: Literal["ray.io/v1"]
    kind: Literal["RayCluster"]
    metadata: Metadata
    spec: ClusterSpec
