"""The embedded sample collection: made furniture, vehicles and animals as a ShapeNet-like folder."""

from pnabs.dataset.samples.collection import (
    CATEGORIES,
    SampleModel,
    make_model,
    write_collection,
)

__all__ = ["CATEGORIES", "SampleModel", "make_model", "write_collection"]
