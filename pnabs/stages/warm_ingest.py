"""Importing this module makes ingest's compiled kernels ready.

The fork server of a worker's children imports it once, so that no child compiles
or loads kernels for itself.
"""

from pnabs.geometry.fields import warm_up

warm_up()
