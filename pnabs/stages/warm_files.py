"""Importing this module makes ready what `pnabs abstract` loads and compiles.

As `warm_ingest`, for its children.
"""

import torch

import pnabs.model.predict
import pnabs.stages.file_work  # noqa: F401
from pnabs.geometry import fields, measure
from pnabs.geometry.fit import fit

# Before the fork: a child that finds threads of its parent's missing would wait for them.
torch.set_num_threads(1)
fields.warm_up()
measure.warm_up()
fit.warm_up()
