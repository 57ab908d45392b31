"""Importing this module makes ready what evaluating loads and compiles.

The fork server of a worker's children imports it once, so that no child loads for itself.
"""

import pnabs.evaluation.task  # noqa: F401
from pnabs.geometry import fields, measure

fields.warm_up()
measure.warm_up()
