"""`abstraction.glb`: the cropped mesh as binary glTF 2.0; `abstraction.parts.glb`: its parts.

Vertices are in the normalised frame, where float32 is exact enough, and the outermost
node's matrix is the transform to the input's coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pnabs.formats.abstraction import Abstraction
from pnabs.formats.gltf_document import GltfDocument
from pnabs.formats.json_format import VERSION, cuboid_records
from pnabs.geometry.parts import cropped_parts


def to_glb(abstraction: Abstraction) -> bytes:
    """The checked mesh as binary glTF; the same abstraction gives the same bytes.

    Each positive's faces are a primitive of their own colour; all primitives share one
    accessor of vertices, so that together they are the closed mesh.  The cuboids are in the
    node's extras.

    Parameters
    ----------
    abstraction : Abstraction

    Returns
    -------
    bytes
        A file without a mesh if the result is empty.
    """
    solid = abstraction.solid
    document = GltfDocument()
    node = _root("solid", abstraction)
    document.add_node(node)
    if not solid.is_empty:
        order = np.argsort(solid.source, kind="stable")
        sources, counts = np.unique(solid.source, return_counts=True)
        faces = solid.faces[order]
        node["mesh"] = document.add_mesh(
            "solid", solid.vertices, faces, counts.tolist(), sources.tolist()
        )
    return document.to_bytes()


def to_parts(abstraction: Abstraction) -> bytes:
    """What is left of each positive as a closed mesh in a node of its own (binary glTF).

    Nodes are named after the positives; one that a negative cut in two has two.  Parts
    overlap where the positives do.

    Parameters
    ----------
    abstraction : Abstraction

    Returns
    -------
    bytes
        A file with the outermost node alone if the result is empty.
    """
    document = GltfDocument()
    root = _root("abstraction", abstraction)
    document.add_node(root)
    children = []
    parts = cropped_parts(abstraction.positives, abstraction.negatives, abstraction.recipe)
    for number, part in enumerate(parts):
        before = sum(other.source == part.source for other in parts[:number])
        name = f"positive {part.source}" + (f" part {before + 1}" if before else "")
        vertices, count = part.vertices.astype(np.float32), len(part.faces)
        mesh = document.add_mesh(name, vertices, part.faces, [count], [part.source])
        children.append(document.add_node({"name": name, "mesh": mesh}))
    if children:
        root["children"] = children
    return document.to_bytes()


def _root(name: str, abstraction: Abstraction) -> dict[str, Any]:
    """A node that places what is below it in the input's coordinates."""
    # glTF stores matrices column by column.
    columns = np.asarray(abstraction.transform, dtype=np.float64).T.ravel().tolist()
    return {
        "name": name,
        "matrix": columns,
        "extras": {
            "format": "pnabs/abstraction",
            "version": VERSION,
            "category": abstraction.category,
            "model_id": abstraction.model_id,
            "positives": cuboid_records(abstraction.positives),
            "negatives": cuboid_records(abstraction.negatives),
        },
    }
