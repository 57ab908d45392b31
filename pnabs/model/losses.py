"""The loss terms (METHOD, losses; the paper's section 3.5).

Sums of the paper are expectations here, so sample counts don't change weights.  A new term is
one function of a `View` and one line in `TERMS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from pnabs import settings
from pnabs.geometry.types import THETA_D
from pnabs.model import cuboids as geometry
from pnabs.model.data import Batch
from pnabs.model.field import interpolate

PHASES = ("initial", "refinement")
MODULES = ("positive", "negative")

WARM, COLD = 0.03, 0.0075
"""The soft union's temperature at a phase's beginning and end, in normalised units."""

SYMMETRY_LATTICE = 3
"""Lattice side of the samples that compare two cuboids: corners, edges, faces and centre."""

OVERLAP_LATTICE = 6
"""Lattice side of the samples that estimate a cuboid's overlap with its mirror image."""


@dataclass(frozen=True, slots=True)
class View:
    """What a term may look at.

    Attributes
    ----------
    steps : tuple of (B, N, 10)
        The prediction that refinement starts from, then each iteration's; one in the initial
        phase.  Terms on the shape judge the last.
    batch : Batch
    training : settings.Training
    progress : float
        How much of the phase is done, 0 to 1.
    generator : torch.Generator
        Source of the term's random samples.
    """

    steps: tuple[Tensor, ...]
    batch: Batch
    training: settings.Training
    progress: float
    generator: torch.Generator

    @property
    def cuboids(self) -> Tensor:
        """The cuboids to judge, (B, N, 10)."""
        return self.steps[-1]


@dataclass(frozen=True, slots=True)
class Term:
    """A loss and where it applies; `weight` names its field of `settings.LossWeights`."""

    value: Callable[[View], Tensor]
    weight: str
    phases: tuple[str, ...] = PHASES
    modules: tuple[str, ...] = MODULES


def fit1(view: View) -> Tensor:
    """Cuboid samples to the shape (Eq. 2): mean of d(p, S)^2 over the cuboids' volumes."""
    samples = geometry.sample_volume(view.cuboids, view.training.cuboid_samples, view.generator)
    signed = interpolate(view.batch.sdf, samples.flatten(1, 2))
    each = signed.relu().square().view(samples.shape[:3]).mean(dim=2)
    volume = geometry.volumes(view.cuboids) + 1e-9
    return ((each * volume).sum(dim=1) / volume.sum(dim=1)).mean()


def fit2(view: View) -> Tensor:
    """Shape samples to the cuboids (Eq. 2): mean of d(p, C)^2."""
    return geometry.union_distance(view.cuboids, view.batch.points).square().mean()


def box_keys(cuboids: Tensor) -> Tensor:
    """Centres and square roots of covariances, (B, N, 12): equal for boxes equal as sets.

    Distances of keys bound the Wasserstein distance of the boxes' Gaussians from above.
    """
    rotation = geometry.rotation_matrices(cuboids)
    scale = cuboids[..., :3].unsqueeze(-2) / math.sqrt(12)
    roots = (rotation * scale @ rotation.transpose(-1, -2)).flatten(-2)
    return torch.cat([cuboids[..., 7:], roots], dim=-1)


def _mirror_distance(cuboids: Tensor, axis: Tensor) -> Tensor:
    """Squared Chamfer distance of each cuboid to the nearest mirrored one, (B, N).

    The nearest is picked by the distance of keys, which is blind to how a box names its own axes;
    the Chamfer distance is computed for that pair alone.
    """
    image = geometry.mirror(cuboids, axis)
    with torch.no_grad():
        key, other = box_keys(cuboids), box_keys(image)
        partner = (key.unsqueeze(2) - other.unsqueeze(1)).square().sum(-1).argmin(dim=2)
    nearest = image.gather(1, partner.unsqueeze(-1).expand_as(image))
    unit = geometry.lattice(SYMMETRY_LATTICE, cuboids)
    a = geometry.transform(cuboids, unit).flatten(0, 1)
    b = geometry.transform(nearest, unit).flatten(0, 1)
    with torch.no_grad():
        gaps = torch.cdist(a, b, compute_mode="donot_use_mm_for_euclid_dist")
        forth, back = gaps.argmin(dim=2, keepdim=True), gaps.argmin(dim=1).unsqueeze(-1)
    there = (a - b.gather(1, forth.expand_as(a))).square().sum(-1).mean(-1)
    again = (b - a.gather(1, back.expand_as(b))).square().sum(-1).mean(-1)
    return (there + again).view(cuboids.shape[:2])


@torch.no_grad()
def self_overlap(cuboids: Tensor, axis: Tensor) -> Tensor:
    """IoU of each cuboid with its own mirror image, (B, N), estimated on a lattice inside it."""
    batch, count = cuboids.shape[:2]
    unit = geometry.lattice(OVERLAP_LATTICE, cuboids) * (1 - 1 / OVERLAP_LATTICE)
    points = geometry.transform(cuboids, unit).flatten(0, 1)
    image = geometry.mirror(cuboids, axis).view(batch * count, 1, geometry.PARAMETERS)
    inside = (geometry.signed_distances(image, points) <= 0).float().mean(dim=(1, 2))
    return (inside / (2 - inside)).view(batch, count)


def symmetry(view: View) -> Tensor:
    """Squared Chamfer distance to the nearest mirrored cuboid (Eq. 3), mean over cuboids.

    Shapes without a mirror plane count as 0.
    """
    each = _mirror_distance(view.cuboids, view.batch.mirror)
    return (each * (view.batch.mirror >= 0).unsqueeze(1)).mean()


def conditional_symmetry(view: View) -> Tensor:
    """Symmetry only of cuboids that don't overlap their own mirror image much (Eq. 5)."""
    each = _mirror_distance(view.cuboids, view.batch.mirror)
    apart = self_overlap(view.cuboids, view.batch.mirror) <= view.training.symmetry_alpha
    return (each * (apart & (view.batch.mirror >= 0).unsqueeze(1))).mean()


def rotation_angle(before: Tensor, after: Tensor) -> Tensor:
    """Geodesic angle between unit quaternions (..., 4), radians, with a finite gradient at 0."""
    sign = torch.where((before * after).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    chord = geometry.norm(after - sign * before) / 2
    return 4 * torch.asin(chord.clamp(max=math.sqrt(0.5)))


def regularisation(view: View) -> Tensor:
    """Squared excess of one iteration's change over its threshold (Eqs. 6 and 7).

    Norms of the changes of full sides and translation in normalised units, the rotation's angle
    in radians; mean over cuboids and iterations.
    """
    training = view.training
    before, after = torch.stack(view.steps[:-1]), torch.stack(view.steps[1:])
    change = after - before
    sides = geometry.norm(change[..., :3])
    move = geometry.norm(change[..., 7:])
    angle = rotation_angle(before[..., 3:7], after[..., 3:7])
    return (
        (sides - training.theta_scale).relu().square()
        + (move - training.theta_translation).relu().square()
        + (angle - math.radians(training.theta_rotation)).relu().square()
    ).mean()


def separation(view: View) -> Tensor:
    """Points of the original's interior nearer to a negative than theta_d (Eq. 9)."""
    points = view.batch.shape_interior
    if points is None:
        raise ValueError("the separation loss needs the training set's shape_interior")
    return geometry.closeness(view.cuboids, points, THETA_D)


def temperature(progress: float) -> float:
    """The soft union's temperature, falling geometrically over a phase."""
    return WARM * math.pow(COLD / WARM, progress)


def occupancy(view: View) -> Tensor:
    """Cross-entropy plus one minus soft IoU of the soft union at grid points (ours)."""
    batch = view.batch
    logits = geometry.soft_occupancy(view.cuboids, batch.cells, temperature(view.progress))
    entropy = F.binary_cross_entropy_with_logits(logits, batch.inside)
    share = logits.sigmoid()
    common = (share * batch.inside).sum(dim=1)
    either = (share + batch.inside).sum(dim=1) - common
    return entropy + 1 - (common / either.clamp(min=1e-6)).mean()


TERMS: dict[str, Term] = {
    "fit1": Term(fit1, "fit1"),
    "fit2": Term(fit2, "fit2"),
    "symmetry": Term(symmetry, "symmetry", phases=("initial",)),
    "conditional_symmetry": Term(conditional_symmetry, "symmetry", phases=("refinement",)),
    "regularisation": Term(regularisation, "regularisation", phases=("refinement",)),
    "separation": Term(separation, "separation", modules=("negative",)),
    "occupancy": Term(occupancy, "occupancy"),
}
"""All terms by name: Eqs. 4 and 8, L_sep (3.5.3) and ours."""


def active_terms(module: str, phase: str, weights: settings.LossWeights) -> dict[str, float]:
    """Names and weights of the terms that a module's phase sums, zero weights left out."""
    chosen = {
        name: float(getattr(weights, term.weight))
        for name, term in TERMS.items()
        if phase in term.phases and module in term.modules
    }
    return {name: weight for name, weight in chosen.items() if weight > 0}
