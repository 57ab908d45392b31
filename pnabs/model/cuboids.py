"""Differentiable cuboid geometry on batches of parameter vectors.

A batch of cuboids is a tensor (B, N, 10) in the layout of `Cuboids.as_vector`: full side
lengths, unit quaternion (w first), translation.  Points are (B, P, 3).  All lengths are
in the normalised frame.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor

from pnabs.geometry.types import GRID_SIDE

PARAMETERS = 10
"""Numbers a cuboid."""


def norm(vectors: Tensor, dim: int = -1) -> Tensor:
    """Euclidean norm along a dimension; its gradient at zero is zero."""
    return cast(Tensor, torch.linalg.vector_norm(vectors, dim=dim))


def split(cuboids: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Scale (..., 3), rotation (..., 4) and translation (..., 3) of cuboids (..., 10)."""
    return cuboids[..., :3], cuboids[..., 3:7], cuboids[..., 7:]


def volumes(cuboids: Tensor) -> Tensor:
    """Volumes (...,) of cuboids (..., 10)."""
    return cuboids[..., 0] * cuboids[..., 1] * cuboids[..., 2]


def rotation_matrices(cuboids: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) that lead from a cuboid's own axes to the frame's."""
    w, x, y, z = cuboids[..., 3:7].unbind(-1)
    entries = [
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    ]
    return torch.stack(entries, dim=-1).view(*cuboids.shape[:-1], 3, 3)


def transform(cuboids: Tensor, unit: Tensor) -> Tensor:
    """Points of the unit cube, mapped into each cuboid.

    Parameters
    ----------
    cuboids : (B, N, 10)
    unit : (B, N, K, 3) or (K, 3)
        Points of [-1/2, 1/2]^3.

    Returns
    -------
    (B, N, K, 3)
    """
    return place(cuboids, cuboids[..., None, :3] * unit)


def place(cuboids: Tensor, local: Tensor) -> Tensor:
    """Points (B, N, K, 3) of each cuboid's own frame, lengths kept, in the normalised frame."""
    rotation = rotation_matrices(cuboids)
    return local @ rotation.transpose(-1, -2) + cuboids[..., None, 7:]


def sample_volume(cuboids: Tensor, count: int, generator: torch.Generator) -> Tensor:
    """Uniform random points inside each cuboid, (B, N, count, 3)."""
    unit = torch.rand(
        (*cuboids.shape[:2], count, 3),
        generator=generator,
        device=cuboids.device,
        dtype=cuboids.dtype,
    )
    return transform(cuboids, unit - 0.5)


def _excess(cuboids: Tensor, points: Tensor) -> Tensor:
    """How far each point lies beyond each pair of faces, (B, 3, N, P); negative between them."""
    scale, _, translation = split(cuboids)
    batch, count = cuboids.shape[:2]
    to_local = rotation_matrices(cuboids).permute(0, 3, 1, 2)
    offset = -(to_local * translation.unsqueeze(1)).sum(-1)
    local = torch.baddbmm(
        offset.reshape(batch, 3 * count, 1),
        to_local.reshape(batch, 3 * count, 3),
        points.transpose(1, 2),
    ).view(batch, 3, count, points.shape[1])
    return local.abs() - scale.transpose(1, 2).unsqueeze(-1) / 2


def signed_distances(cuboids: Tensor, points: Tensor) -> Tensor:
    """Exact signed distance of every point to every cuboid, (B, N, P), negative inside."""
    return _signed(_excess(cuboids, points))


def _signed(excess: Tensor) -> Tensor:
    """Signed distance from the three excesses along dimension 1."""
    return norm(excess.relu(), dim=1) + excess.amax(dim=1).clamp(max=0)


@torch.no_grad()
def nearest(cuboids: Tensor, points: Tensor) -> Tensor:
    """Index of the cuboid with the least signed distance to each point, (B, P) int64.

    Cuboids are visited one after the other: every intermediate then stays in the cache, which
    halves the time of one pass over all pairs.
    """
    matrices = rotation_matrices(cuboids).transpose(-1, -2)
    half = cuboids[..., :3].unsqueeze(-1) / 2
    offset = -(matrices @ cuboids[..., 7:].unsqueeze(-1))
    columns = points.transpose(1, 2).contiguous()
    best = torch.full(points.shape[:2], torch.inf, device=points.device, dtype=points.dtype)
    index = torch.zeros(points.shape[:2], device=points.device, dtype=torch.int64)
    for i in range(cuboids.shape[1]):
        excess = torch.baddbmm(offset[:, i], matrices[:, i], columns).abs_().sub_(half[:, i])
        a, b, c = excess.unbind(1)
        depth = torch.maximum(torch.maximum(a, b), c).clamp_(max=0)
        excess.clamp_(min=0).square_()
        signed = a.add_(b).add_(c).sqrt_().add_(depth)
        closer = signed < best
        best = torch.where(closer, signed, best)
        index.masked_fill_(closer, i)
    return index


def union_signed_distance(cuboids: Tensor, points: Tensor) -> Tensor:
    """Signed distance to the union, (B, P): the least of the cuboids' own.

    Exact outside, a lower bound of the depth inside.  Only the nearest cuboid of a point
    receives its gradient, so only that one is differentiated.
    """
    batch, count = cuboids.shape[:2]
    winner = nearest(cuboids, points)
    winner = winner + count * torch.arange(batch, device=winner.device).unsqueeze(1)
    excess = _chosen_excess(cuboids, winner.flatten(), points.flatten(0, 1))
    return _signed(excess).view(points.shape[:2])


def _chosen_excess(cuboids: Tensor, chosen: Tensor, points: Tensor) -> Tensor:
    """`_excess` of each point (K, 3) beside one cuboid of all, by its flat index (K,): (K, 3)."""
    rotation = rotation_matrices(cuboids).transpose(-1, -2).flatten(0, 1).flatten(1)
    scale, _, translation = split(cuboids)
    packed = torch.cat([rotation, scale.flatten(0, 1) / 2, translation.flatten(0, 1)], dim=1)
    rows = packed.index_select(0, chosen)
    to_local, half, centre = rows[:, :9].view(-1, 3, 3), rows[:, 9:12], rows[:, 12:]
    return (to_local * (points - centre).unsqueeze(1)).sum(-1).abs() - half


def closeness(cuboids: Tensor, points: Tensor, reach: float) -> Tensor:
    """Mean of `reach` less the distance, where that is positive, over all cuboids and points.

    Few points are that near to a cuboid, so only those pairs are differentiated: the others,
    and points inside, have no gradient.
    """
    batch, count = cuboids.shape[:2]
    pairs, inside = _near_pairs(cuboids, points, reach)
    owner, which, place = pairs
    near = points[owner, place]
    apart = norm(_chosen_excess(cuboids, owner * count + which, near).relu(), dim=1)
    total = (reach - apart).sum() + reach * inside
    return total / (batch * count * points.shape[1])


@torch.no_grad()
def _near_pairs(
    cuboids: Tensor, points: Tensor, reach: float
) -> tuple[tuple[Tensor, Tensor, Tensor], int]:
    """Rows, cuboids and points of pairs nearer than `reach` but apart; how many points are inside.

    Cuboids are visited one after the other, as in `nearest`.
    """
    matrices = rotation_matrices(cuboids).transpose(-1, -2)
    half = cuboids[..., :3].unsqueeze(-1) / 2
    offset = -(matrices @ cuboids[..., 7:].unsqueeze(-1))
    columns = points.transpose(1, 2).contiguous()
    rows, owners, places, inside = [], [], [], 0
    for i in range(cuboids.shape[1]):
        excess = torch.baddbmm(offset[:, i], matrices[:, i], columns).abs_().sub_(half[:, i])
        squared = excess.clamp_(min=0).square_().sum(dim=1)
        inside += int(torch.count_nonzero(squared == 0))
        row, place = torch.nonzero((squared > 0) & (squared < reach * reach), as_tuple=True)
        rows.append(row)
        places.append(place)
        owners.append(torch.full_like(row, i))
    return (torch.cat(rows), torch.cat(owners), torch.cat(places)), inside


def union_distance(cuboids: Tensor, points: Tensor) -> Tensor:
    """Distance to the union, (B, P): zero inside; exact, with the nearest cuboid's gradient."""
    return union_signed_distance(cuboids, points).relu()


def soft_occupancy(cuboids: Tensor, points: Tensor, temperature: float) -> Tensor:
    """Logits of a point's being in the union, (B, P): minus its signed distance by temperature."""
    return union_signed_distance(cuboids, points) / -temperature


def mirror(cuboids: Tensor, axis: Tensor) -> Tensor:
    """Cuboids mirrored across the plane through the origin with the given normal.

    Parameters
    ----------
    cuboids : (B, N, 10)
    axis : (B,) int
        0, 1, 2 for x -> -x, y -> -y, z -> -z; -1 leaves the sample as it is.

    Returns
    -------
    (B, N, 10)
        The mirror image of a box is a box: conjugating its rotation with the reflection keeps
        the quaternion's scalar part and its component along the normal and flips the others.
    """
    signs = torch.ones((4, PARAMETERS), device=cuboids.device, dtype=cuboids.dtype)
    for normal in range(3):
        signs[normal, 4:7] = -1
        signs[normal, 4 + normal] = 1
        signs[normal, 7 + normal] = -1
    return cuboids * signs[axis].unsqueeze(1)


def mirror_points(points: Tensor, axis: Tensor) -> Tensor:
    """Points (B, P, 3) mirrored likewise."""
    signs = 1 - 2 * torch.eye(4, 3, device=points.device, dtype=points.dtype)
    return points * signs[axis].unsqueeze(1)


def lattice(side: int, like: Tensor) -> Tensor:
    """The regular lattice of side^3 points that spans the unit cube, corners included, (side^3, 3).

    It is symmetric under the cube's own symmetries, so cuboids that coincide as sets have
    coinciding lattices.
    """
    axis = torch.linspace(-0.5, 0.5, side, device=like.device, dtype=like.dtype)
    return torch.cartesian_prod(axis, axis, axis)


@torch.no_grad()
def coverage(cuboids: Tensor, resolution: int = 32) -> Tensor:
    """A volume of the union at the grid's cell centres, (B, 1, G, G, G) in [0, 1], x slowest.

    A cell's value falls linearly from 1 to 0 while a cuboid's face passes through it (excess
    over the nearest faces from minus to plus half a cell), so thin cuboids leave a trace.
    """
    cell = GRID_SIDE / resolution
    axis = (torch.arange(resolution, device=cuboids.device, dtype=cuboids.dtype) + 0.5) * cell
    axis = axis - GRID_SIDE / 2
    columns = torch.cartesian_prod(axis, axis, axis).T.contiguous()
    to_local = rotation_matrices(cuboids).transpose(-1, -2)
    half = cuboids[..., :3].unsqueeze(-1) / 2
    offset = -(to_local @ cuboids[..., 7:].unsqueeze(-1))
    excess = cuboids.new_full((len(cuboids), resolution**3), torch.inf)
    for sample, least in enumerate(excess.unbind(0)):
        # One cuboid of one sample at a time: the volume stays in the cache.
        for i in range(cuboids.shape[1]):
            local = torch.addmm(offset[sample, i], to_local[sample, i], columns)
            torch.minimum(least, local.abs_().sub_(half[sample, i]).amax(dim=0), out=least)
    values = (0.5 - excess / cell).clamp_(0, 1)
    return values.view(-1, 1, resolution, resolution, resolution)
