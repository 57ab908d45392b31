"""For physics engines: URDF and MJCF, in which every piece is convex.

A cuboid that no negative touches is a box of the engine's own; what a negative hollowed out
is split exactly (`pnabs.geometry.parts.convex_parts`), so that the opening stays open.
Pieces overlap where the positives do, so mass, centre and inertia are those of the checked
mesh, filled evenly.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation
from trimesh.triangles import mass_properties

from pnabs.formats.abstraction import Abstraction, FormatError
from pnabs.geometry.parts import Part, convex_parts
from pnabs.geometry.types import Float64

DENSITY = 1000.0
"""Mass a cube of the input's unit: that of water, where the unit is a metre."""


LEAST_INERTIA = 1e-12
"""Principal moments below this are left out for MuJoCo: those of a body of a few thousandths."""


# What no XML document may hold.
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True)
class _Body:
    """An abstraction as a rigid body.

    Attributes
    ----------
    parts
        Its convex pieces, in the normalised frame.
    size
        Length of the normalised frame's unit in the input's coordinates.
    rotation, position
        Of the normalised frame in the input's coordinates.
    mass, centre, inertia
        In the input's unit, with `DENSITY`; centre and axes in the normalised frame.
    """

    parts: list[Part]
    size: float
    rotation: Rotation
    position: Float64
    mass: float
    centre: Float64
    inertia: Float64


def to_urdf(abstraction: Abstraction, stem: str) -> dict[str, bytes]:
    """URDF: one link, each convex piece a collision and a visual.

    Pieces that are no cuboids are OBJ files beside it, in the normalised frame; the URDF scales
    and places them.

    Parameters
    ----------
    abstraction : Abstraction
    stem : str
        Of the file's name.

    Returns
    -------
    dict
        File name -> content: `<stem>.convex/<number>.obj`, and `<stem>.urdf`.

    Raises
    ------
    FormatError
        When the transform does more than turn, scale evenly and shift.
    """
    body = _body(abstraction)
    files: dict[str, bytes] = {}
    robot = ElementTree.Element("robot", name=_name(abstraction))
    link = ElementTree.SubElement(robot, "link", name="abstraction")
    if body.mass:
        inertial = ElementTree.SubElement(link, "inertial")
        _origin(inertial, body, body.centre, Rotation.identity())
        ElementTree.SubElement(inertial, "mass", value=_text(body.mass))
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        values = map(_text, body.inertia[np.triu_indices(3)])
        ElementTree.SubElement(inertial, "inertia", dict(zip(names, values, strict=True)))
    for number, part in enumerate(body.parts):
        if part.box is None:
            file = f"{stem}.convex/{number:03d}.obj"
            files[file] = _obj(part)
        for kind in ("visual", "collision"):
            element = ElementTree.SubElement(link, kind, name=f"{kind}_{number}")
            if part.box is None:
                _origin(element, body, np.zeros(3), Rotation.identity())
            else:
                turn = _rotation(part.box.rotation[0])
                _origin(element, body, part.box.translation[0], turn)
            geometry = ElementTree.SubElement(element, "geometry")
            if part.box is None:
                scale = _text(body.size, body.size, body.size)
                ElementTree.SubElement(geometry, "mesh", filename=file, scale=scale)
            else:
                ElementTree.SubElement(
                    geometry, "box", size=_text(*(body.size * part.box.scale[0]))
                )
    return {**files, f"{stem}.urdf": _xml(robot)}


def to_mjcf(abstraction: Abstraction) -> bytes:
    """MuJoCo's XML: one body, each convex piece a geom; complete in itself.

    The body is fixed to the world; a `<freejoint/>` in it lets it move.

    Raises
    ------
    FormatError
        When the transform does more than turn, scale evenly and shift.
    """
    body = _body(abstraction)
    root = ElementTree.Element("mujoco", model=_name(abstraction))
    asset = ElementTree.SubElement(root, "asset")
    world = ElementTree.SubElement(root, "worldbody")
    element = ElementTree.SubElement(
        world,
        "body",
        name="abstraction",
        pos=_text(*body.position),
        quat=_text(*body.rotation.as_quat(scalar_first=True)),
    )
    # MuJoCo takes no inertia that is all but zero, given or reckoned from the pieces.
    massive = bool(np.linalg.eigvalsh(body.inertia).min() > LEAST_INERTIA)
    if massive:
        ElementTree.SubElement(
            element,
            "inertial",
            pos=_text(*(body.size * body.centre)),
            mass=_text(body.mass),
            fullinertia=_text(*body.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]),
        )
    for number, part in enumerate(body.parts):
        geom = ElementTree.SubElement(element, "geom", name=f"piece_{number}")
        if not massive:
            geom.set("mass", "0")
        if part.box is not None:
            geom.set("type", "box")
            geom.set("size", _text(*(body.size * part.box.scale[0] / 2)))
            geom.set("pos", _text(*(body.size * part.box.translation[0])))
            geom.set("quat", _text(*part.box.rotation[0]))
            continue
        geom.set("type", "mesh")
        geom.set("mesh", f"piece_{number}")
        ElementTree.SubElement(
            asset,
            "mesh",
            name=f"piece_{number}",
            vertex=_text(*(body.size * part.vertices).ravel()),
            # Only the frame of a geom hangs on it, and a surface is never too small a volume.
            inertia="shell",
        )
    return _xml(root)


def _body(abstraction: Abstraction) -> _Body:
    matrix = np.asarray(abstraction.transform, dtype=np.float64)
    linear = matrix[:3, :3]
    size = float(np.cbrt(np.linalg.det(linear)))
    square = linear @ linear.T
    if size <= 0 or np.abs(square - size**2 * np.eye(3)).max() > 1e-9 * size**2:
        raise FormatError(
            "the transform does more than turn, scale evenly and shift: boxes would be none in "
            "the input's coordinates"
        )
    mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    if not abstraction.solid.is_empty:
        found = mass_properties(abstraction.solid.triangles, density=1.0)
        mass = DENSITY * size**3 * float(found["mass"])
        centre = np.asarray(found["center_mass"])
        inertia = DENSITY * size**5 * np.asarray(found["inertia"])
    parts = convex_parts(abstraction.positives, abstraction.negatives, abstraction.recipe)
    turn = Rotation.from_matrix(linear / size)
    return _Body(parts, size, turn, matrix[:3, 3], mass, centre, inertia)


def _origin(parent: ElementTree.Element, body: _Body, at: Float64, turn: Rotation) -> None:
    """Place an element of a URDF, given in the normalised frame."""
    position = body.position + body.size * body.rotation.apply(at)
    with warnings.catch_warnings():
        # Where two of the angles turn about one axis, any of the equal answers will do.
        warnings.filterwarnings("ignore", message="Gimbal lock")
        angles = (body.rotation * turn).as_euler("xyz")
    ElementTree.SubElement(parent, "origin", xyz=_text(*position), rpy=_text(*angles))


def _rotation(quaternion: Float64) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)


def _obj(part: Part) -> bytes:
    lines = [f"v {_text(*point)}" for point in part.vertices]
    lines += ["f {} {} {}".format(*face) for face in (part.faces + 1)]
    return ("\n".join(lines) + "\n").encode("ascii")


def _name(abstraction: Abstraction) -> str:
    return _NOT_XML.sub("_", abstraction.model_id) or "abstraction"


def _text(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _xml(root: ElementTree.Element) -> bytes:
    ElementTree.indent(root, " ")
    text: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
