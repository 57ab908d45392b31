"""The embedded sample collection: furniture, vehicles and animals in a ShapeNet-like folder."""

from pnabs.dataset.samples.collection import (
    CATEGORIES,
    SampleModel,
    make_model,
    write_collection,
)

__all__ = ["CATEGORIES", "SampleModel", "make_model", "write_collection"]
