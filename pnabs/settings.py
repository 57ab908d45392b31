"""Every setting, typed, documented and validated: the schema of a job file.

Settings are grouped by what they change.  `Runtime` and `Report` never change a
model's results and stay out of every fingerprint.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    PositiveInt,
    field_validator,
    model_validator,
)

SHIPPED_WEIGHTS = Path(__file__).parent / "weights"
"""The weights that come with pnabs."""

Share = Annotated[float, Field(ge=0, le=1)]
Moment = Annotated[float, Field(ge=0, lt=1)]
Layout = Literal["shapenet-v1", "shapenet-v2", "folder"]
FormatName = Literal["json", "glb", "parts", "obj", "ply", "stl", "urdf", "mjcf"]

_S3_URL = re.compile(r"s3://([A-Za-z0-9][A-Za-z0-9._-]{1,61}[A-Za-z0-9])(?:/(.*?)/?)?")
# pathlib makes one slash of two.
_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")


def split_s3_url(url: str) -> tuple[str, str]:
    """Bucket and prefix of `s3://bucket/prefix`, the prefix without a closing slash.

    Raises
    ------
    ValueError
        If it isn't such a URL, or its prefix isn't a plain path.
    """
    match = _S3_URL.fullmatch(url)
    prefix = (match[2] or "") if match else ""
    plain = not re.search(r"[\x00-\x1f\x7f\\]|(^|/)\.{0,2}(/|$)", prefix) or not prefix
    if match is None or not plain:
        raise ValueError(f"{url!r} is not of the form s3://bucket/prefix")
    return match[1], prefix


def _root(value: object) -> object:
    if not isinstance(value, str):
        return value
    if not _URL.match(value):
        return Path(value)
    split_s3_url(value)
    return value


def _on_disk(value: object) -> object:
    if _URL.match(str(value)):
        raise ValueError("must be a folder on a file system that all workers share, not a URL")
    return value


def _weights(value: object) -> object:
    return Path(value) if isinstance(value, str) and value != "shipped" else value


class Group(BaseModel):
    """Base of all groups: unknown keys are errors, values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)


class Dataset(Group):
    """Where the meshes come from."""

    root: Annotated[Path | str, BeforeValidator(_root)]
    """Folder of the collection, or one zip file; relative paths count from where pnabs is run.
    Either may lie in a bucket: `s3://bucket/prefix` (needs pnabs[s3])."""
    layout: Layout = "shapenet-v2"
    """How models lie below `root`."""
    categories: tuple[str, ...] | None = None
    """Categories to take, by folder name or alias (`chair` = 03001627); all when left out."""

    @field_validator("categories", mode="before")
    @classmethod
    def _one_is_a_list_of_one(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    split: Path | Literal["hash"] = "hash"
    """`hash` (the paper's two thirds train, one third test, by a hash of the id), or a csv
    in the form of ShapeNet's all.csv (columns synsetId, modelId, split)."""
    test_share: Share = 1 / 3
    """Share of a category that tests, for `split: hash`."""
    val_share: Share = 0.0
    """Share of a category held out for validation, for `split: hash`; taken from training."""
    limit: PositiveInt | None = None
    """At most so many models a category (the first by id)."""
    shard_size: PositiveInt = 64
    """Models a shard: the unit of commit and resume."""


class Limits(Group):
    """What a mesh may cost, checked before the cost is paid."""

    max_bytes: PositiveInt = 256 * 2**20
    """Largest mesh file, uncompressed."""
    max_faces: PositiveInt = 2_000_000
    """Most triangles of a mesh."""
    exact_faces: PositiveInt = 100_000
    """Most triangles of a mesh whose boundary is kept, for exact volumes and distances. Models with
    more are counted as not measured by these."""


class Solid(Group):
    """How polygon soups become solids."""

    open: Literal["fill", "shell"] = "fill"
    """Open tubes and shades count as filled (`fill`), or keep only their sheets (`shell`)."""
    sheet: Annotated[float, Field(ge=0, le=0.1)] = 0.005
    """Thickness that a sheet without any counts as having when distances are measured, as a share
    of the model's longest side."""
    mirror: Literal["auto", "layout", "x", "y", "z", "none"] = "auto"
    """Mirror axis of a model: the best of x and z by the solid's mirror IoU (`auto`), the
    layout's convention (`layout`: z for shapenet-v1, x for shapenet-v2), or fixed."""
    mirror_threshold: Share = 0.8
    """Below this mirror IoU a model counts as asymmetric (`auto`)."""


class Ingest(Group):
    """What is computed from each mesh and kept."""

    limits: Limits = Limits()
    solid: Solid = Solid()
    surface_points: PositiveInt = 10_000
    """Points with normals sampled on the solid's surface."""
    interior_points: PositiveInt = 2_048
    """Points sampled in the solid's interior."""
    preview_faces: PositiveInt = 5_000
    """Most triangles of the preview that the report's pictures show."""


class Network(Group):
    """The prediction network; the positive and the negative module are two of it."""

    positives: PositiveInt = 12
    """Positive cuboids."""
    negatives: PositiveInt = 8
    """Negative cuboids."""
    channels: Annotated[tuple[PositiveInt, ...], Field(min_length=5, max_length=5)] = (
        8, 16, 32, 64, 128,
    )  # fmt: skip
    """Channels of the encoder's five blocks (POSPRIM: 4-8-16-32-64)."""
    hidden: PositiveInt = 256
    """Width of the fully connected layers."""
    start: Literal["octants", "farthest"] = "farthest"
    """Where cuboids start: octant centres (eight only), or farthest points of the training
    shapes' mean occupancy."""
    refine_input: Literal["vector", "volume", "probes"] = "probes"
    """Refinement reads the previous cuboids as numbers (`vector`, the paper), also as a volume
    through the encoder (`volume`), or each cuboid reads the input volume around itself
    (`probes`)."""


class LossWeights(Group):
    """Weight of each term (METHOD, losses); a weight of 0 switches the term off."""

    fit1: NonNegativeFloat = 1.0
    """Cuboid samples to the shape (Eq. 2)."""
    fit2: NonNegativeFloat = 1.0
    """Shape samples to the cuboids (Eq. 2)."""
    symmetry: NonNegativeFloat = 1.0
    """Symmetry (Eq. 3), in refinement the conditional form (Eq. 5)."""
    regularisation: NonNegativeFloat = 1.0
    """Excess of one iteration's change (Eqs. 6, 7)."""
    separation: NonNegativeFloat = 10.0
    """Negatives apart from the shape's interior (Eq. 9; 1 = the paper)."""
    occupancy: NonNegativeFloat = 0.1
    """Cross-entropy and soft IoU of a soft union at grid points (ours; 0 = the paper)."""

    @model_validator(mode="after")
    def _something_to_train(self) -> LossWeights:
        if not (self.fit1 or self.fit2 or self.symmetry or self.occupancy):
            raise ValueError("with fit1, fit2, symmetry and occupancy all 0 nothing is trained")
        return self


class Training(Group):
    """The four phases: initial and refinement, of the positive and then the negative module."""

    init_from: Annotated[Path | Literal["shipped"] | None, BeforeValidator(_weights)] = None
    """Trained weights that both modules begin with: a folder, or `shipped` for those that come with
    pnabs. `network` must be as theirs, but for `start`, which comes with them. Where `weights` are
    given nothing is trained, and this isn't looked at."""
    epochs: PositiveInt = 150
    """Epochs a phase."""
    batch_size: PositiveInt = 32
    """Global batch, over all workers; shapes that don't fill one are spread over the others."""
    learning_rate: PositiveFloat = 0.001
    """Adam's rate."""
    encoder_learning_rate: PositiveFloat = 0.0001
    """Adam's rate for the encoder in refinement, inherited from the initial phase."""
    schedule: Literal["constant", "cosine"] = "cosine"
    """Learning rate over a phase: constant (the paper), or falling to zero along a cosine."""
    betas: tuple[Moment, Moment] = (0.9, 0.999)
    """Adam's moments."""
    iterations: PositiveInt = 3
    """Refinement iterations in training."""
    burn_in: int = Field(default=4, ge=0)
    """Up to so many iterations, a random number, come before those that are trained through: so
    refinement learns to go on from its own later results (0 = the paper)."""
    cuboid_samples: PositiveInt = 64
    """Points sampled in each cuboid for L_fit1."""
    shape_samples: PositiveInt = 1_000
    """Points sampled in the shape for L_fit2, half surface and half interior."""
    occupancy_samples: PositiveInt = 1_280
    """Grid points for the occupancy loss, half of them near the surface."""
    symmetry_alpha: Share = 0.3
    """A cuboid that overlaps its own mirror image more is left out of Eq. 5."""
    theta_scale: PositiveFloat = 0.02
    """Eq. 7's threshold for full sides, a norm in normalised units."""
    theta_translation: PositiveFloat = 0.02
    """Eq. 7's threshold for translation, a norm in normalised units."""
    theta_rotation: PositiveFloat = 20.0
    """Eq. 7's threshold for rotation, in degrees."""
    mirror_augment: bool = True
    """Show each shape mirrored every other time, across its own mirror axis' plane."""
    turn: Annotated[float, Field(ge=0, le=45)] = 15.0
    """Show half of the shapes turned about the up axis, by an angle up to this, in degrees."""
    stretch: Annotated[float, Field(ge=0, le=0.5)] = 0.2
    """Show those shapes stretched along each axis, too, by a share up to this."""
    losses: LossWeights = LossWeights()
    workers: PositiveInt = 1
    """Data-parallel training processes; at most `batch_size`."""

    def init_weights(self, module: str) -> Path | None:
        """The file of a module's weights to begin with; None to begin with nothing."""
        if self.init_from is None:
            return None
        folder = SHIPPED_WEIGHTS if self.init_from == "shipped" else self.init_from
        return folder / f"{module}.safetensors"


class Difference(Group):
    """The difference volume that the negative module learns from."""

    preprocess: bool = True
    """Remove voxels nearer to the shape than theta_d (3.3)."""
    points_per_voxel: PositiveInt = 4
    """Surface samples a kept voxel."""


class Abstract(Group):
    """From predicted cuboids to the written abstraction."""

    negatives: bool = True
    """Crop with negatives at all."""
    fit: bool = True
    """Fit the boxes to each shape: improve, add, take away and exchange them until they agree with
    its solid as well as `boxes` and `min_gain` allow (off = the paper, what the networks say)."""
    boxes: PositiveInt = 20
    """Boxes at most that the fit may use, negatives included."""
    min_gain: Share = 0.002
    """What a box must add to be kept by the fit: IoU, and `cover` times the share of the outer
    surface that comes within 1 % of the longest side of a box."""
    cover: NonNegativeFloat = 0.25
    """What covering all of the outer surface counts beside IoU when boxes are chosen: thin parts
    that carry a shape, such as poles and rails, have little volume."""
    start: Literal["best", "networks", "scattered"] = "best"
    """What the fit begins with: the networks' boxes, none (boxes are then scattered where the shape
    is thickest), or both, of which the better is gone on with."""
    levels: tuple[PositiveInt, ...] = ()
    """Coarser levels of detail that the fit makes beside the finest: numbers of boxes at most, such
    as [4, 8]. A level leaves out boxes of the finer one or puts one in the place of several."""
    postprocess: bool = True
    """Shrink, grow, discard and suppress negatives (3.3)."""
    iterations: PositiveInt = 8
    """Refinement iterations at inference; more than in training where `training.burn_in` let
    refinement learn to go on (the paper preset: 3)."""
    max_overlap: Share = 0.02
    """Share of a negative's volume that may lie in the shape."""
    max_gap: PositiveFloat = 0.5
    """Largest gap between a negative and the shape, in voxels of the 32^3 grid."""
    suppression: Share = 0.6
    """Of two negatives, drop the lesser when more than this share of either lies in the other."""
    min_side: PositiveFloat = 2e-3
    """Shorter sides of positives are raised to this before cropping, so that sheets without
    thickness stay; negatives with a shorter side are left out."""
    debris: Share = 0.01
    """Pieces below this share of the total surface area are dropped."""
    jitter: PositiveFloat = 1e-4
    """Random change of each cuboid when a crop fails its check and is made again."""
    metric_samples: PositiveInt = 10_000
    """Surface samples a side for the Chamfer distances."""
    formats: tuple[FormatName, ...] = ("json", "glb")
    """What is written for each model: `json` (the parameters, from which all others follow), `glb`
    (the checked mesh), `parts` (GLB, a node for what is left of each positive), `obj`, `ply`,
    `stl`, and for physics engines, in convex pieces, `urdf` and `mjcf`; metrics are kept in any
    case."""

    @field_validator("formats", mode="before")
    @classmethod
    def _one_is_a_list_of_one(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @field_validator("levels", mode="before")
    @classmethod
    def _one_level_is_a_list_of_one(cls, value: Any) -> Any:
        return (value,) if isinstance(value, int) else value

    @model_validator(mode="after")
    def _levels_are_fitted(self) -> Abstract:
        if self.levels and not self.fit:
            raise ValueError("levels are made by the fit: leave levels out, or switch fit on")
        return self


class Runtime(Group):
    """Where and how fast; never changes a result."""

    actors: PositiveInt | None = None
    """Ray actors for the sharded stages; one a CPU when left out."""
    threads: PositiveInt = 1
    """Native threads in each process."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where networks run: a GPU when there is one (`auto`)."""
    deadline: PositiveFloat = 120.0
    """Seconds a model may take in a stage before it is given up."""
    memory: PositiveInt = 4 * 2**30
    """Bytes a model's processing may allocate beyond the worker's own."""
    isolation: Literal["child", "none"] = "child"
    """Whether models run in a child process. With `none`, nothing holds `deadline` and `memory`,
    and a crash takes the whole shard's worker along."""
    stall: PositiveFloat = 600.0
    """Seconds without any progress, beyond what a model may take, after which a worker is given
    up and its shard handed to another."""
    checkpoint_epochs: PositiveInt = 10
    """Epochs between a phase's checkpoints."""
    max_failed: Annotated[float, Field(ge=0, le=100)] = 5.0
    """Per cent of the models that may fail in a stage."""


class Report(Group):
    """The tables and the page."""

    pictures: int = Field(default=6, ge=0)
    """Models pictured a category, from best to worst."""
    split: Literal["test", "val", "train", "all"] = "test"
    """Models that the tables cover; all where there is none of these."""


class Settings(Group):
    """A job: one dataset, one run folder, and everything between."""

    dataset: Dataset
    out: Annotated[Path, BeforeValidator(_on_disk)]
    """The run folder."""
    seed: int = Field(default=0, ge=0, lt=2**32)
    """All random numbers come from it and the stage; names and order don't matter."""
    preset: Literal["best", "paper"] = "best"
    """`paper` takes the paper's numbers and nothing beyond them; `best` what measured best."""
    weights: Annotated[Path | Literal["shipped"] | None, BeforeValidator(_weights)] = None
    """Trained weights to use instead of training: a folder, or `shipped` for those that come with
    pnabs (a folder of that name is `./shipped`)."""
    ingest: Ingest = Ingest()
    network: Network = Network()
    training: Training = Training()
    difference: Difference = Difference()
    abstract: Abstract = Abstract()
    runtime: Runtime = Runtime()
    report: Report = Report()
    variants: dict[str, dict[str, Any]] = {"main": {}}
    """Named sets of dotted keys that replace settings for everything from training on."""

    @property
    def weights_folder(self) -> Path | None:
        """The folder of the weights to use instead of training; None to train."""
        return SHIPPED_WEIGHTS if self.weights == "shipped" else self.weights
