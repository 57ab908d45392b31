"""The bytes of a stage don't change unless its version does."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from pnabs.dataset.samples.collection import make_model
from pnabs.geometry.fields import compute_fields
from pnabs.geometry.fit.build import Terms
from pnabs.geometry.fit.fit import fit
from pnabs.geometry.load import parse_mesh
from pnabs.pipeline import model_rng
from pnabs.settings import Ingest
from pnabs.stages.plan import VERSIONS

# Printed by the test when it fails; `pnabs.stages.plan.VERSIONS` rises together with them.
INGEST_VERSION = 4
INGEST = {
    "chair": ("7d3960d0c3b07d04", 28.2441, 65.9661, -7.7426),
    "lamp": ("96e150107abd5a29", -0.3743, -12.6282, -10.4764),
    "ship": ("e01fc0073572bdfb", -7.5081, -97.3045, 0.7401),
}


def summary(category: str) -> tuple[str, float, float, float]:
    """Digest of the solids; sums of the field, the surface samples and the interior ones."""
    options = Ingest()
    mesh = parse_mesh(make_model(category, 7, 4).obj.encode(), ".obj", options.limits)
    rng = model_rng(0, "ingest")
    found = compute_fields(mesh, options, "shapenet-v2", rng)
    solids = (found.occupancy, found.occupancy_64, found.occupancy_128, found.occupancy_192)
    bits = np.packbits(np.concatenate([one.ravel() for one in solids]))
    # weighted, so that no exchange of two values goes unnoticed
    sums = (
        float(values.astype(np.float64).ravel() @ np.linspace(-1, 1, values.size))
        for values in (found.sdf, found.surface, found.interior)
    )
    return hashlib.sha256(bits.tobytes()).hexdigest()[:16], *sums


@pytest.mark.parametrize("category", INGEST)
def test_ingest(category: str) -> None:
    assert VERSIONS["ingest"] == INGEST_VERSION, "new golden values belong to a new version"
    digest, *sums = summary(category)
    expected, *expected_sums = INGEST[category]
    assert (digest, *(round(value, 4) for value in sums)) == (
        expected,
        *(pytest.approx(value, abs=2e-3) for value in expected_sums),
    ), "the stage's bytes changed: raise its version, then note these values"


# Positives, negatives, and a weighted sum of their parameters.
ABSTRACT_VERSION = 6
FIT = {
    "chair": (13, 7, -1.6194),
    "lamp": (20, 0, 0.7846),
    "ship": (11, 9, -2.0933),
}


@pytest.mark.parametrize("category", FIT)
def test_fit(category: str) -> None:
    assert VERSIONS["abstract"] == ABSTRACT_VERSION, "new golden values belong to a new version"
    options = Ingest(surface_points=2000)
    mesh = parse_mesh(make_model(category, 7, 4).obj.encode(), ".obj", options.limits)
    fields = compute_fields(mesh, options, "shapenet-v2", model_rng(0, "ingest"))
    found = fit(
        fields.occupancy_64,
        fields.occupancy_192,
        fields.surface,
        fields.mirror,
        Terms(20, 0.002, 0.25),
        model_rng(0, "abstract"),
        extent=fields.extent,
        min_side=2e-3,
    )
    values = np.concatenate([found.positives.as_vector(), found.negatives.as_vector()]).ravel()
    total = round(float(values.astype(np.float64) @ np.linspace(-1, 1, values.size)), 4)
    expected = FIT[category]
    assert (len(found.positives), len(found.negatives), total) == (
        *expected[:2],
        pytest.approx(expected[2], abs=2e-3),
    ), "the stage's bytes changed: raise its version, then note these values"
