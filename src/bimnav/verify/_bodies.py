"""The robot's body in space: what it sweeps, against the meshes of elements."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import fcl
import numpy as np
import shapely
from numpy.typing import NDArray

from bimnav.verify._plan_view import Track
from bimnav.verify._verdict import Kind, Violation, who
from bimnav.verify._world import World

if TYPE_CHECKING:
    from bimnav.building import Element

__all__ = ["Body", "check_bodies", "make_body"]

_SKIN = 1e-4  # metres; the body in space is thinner by this: the meshes of round things have chords for arcs
_NEAR = 1.0  # metres; how far around the body the clearance in space is measured
_HALF_TURN = 16  # chords of half a round body; they lie inside the circle, so a touch is a true touch
_CONTACTS = 100  # of one element; more would only name the same trouble again


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """An element in space."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    solids: Sequence[NDArray[np.float64]]  # (n, 3, 3) triangles of every shape that has an inside
    collider: fcl.CollisionObject


def make_body(element: Element) -> Body | None:
    """Join the shapes of an element; None if it has no faces."""
    shapes = [(shape.world_vertices(), shape.mesh) for shape in element.shapes if len(shape.mesh.faces)]
    if not shapes:
        return None  # an empty mesh would end the process
    shifts = np.cumsum([0, *(len(vertices) for vertices, _ in shapes)])
    vertices = np.concatenate([vertices for vertices, _ in shapes])
    faces = np.concatenate([mesh.faces + shift for (_, mesh), shift in zip(shapes, shifts[:-1], strict=True)])
    solids = [corners[mesh.faces] for corners, mesh in shapes if mesh.quality != "surface"]
    return Body(vertices, faces, solids, _collider(vertices, faces))


def _collider(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> fcl.CollisionObject:
    model = fcl.BVHModel()
    model.beginModel(len(vertices), len(faces))
    model.addSubModel(vertices, faces)
    model.endModel()
    return fcl.CollisionObject(model, fcl.Transform())


def check_bodies(
    track: Track, world: World, body_of: Callable[[Element], Body | None], found: list[Violation]
) -> float:
    """Refuse pieces where the body meets a mesh; return the clearance in space."""
    low, high = (track.level + height for height in world.band)
    skin = min(_SKIN, (high - low) / 4)
    band = low + skin, high - skin
    radius = max(world.radius - _SKIN, 0.0)
    swept, facets = _swept(track.pieces, radius, *band)
    boxes = shapely.box(*world.bounds[:, 0, :2].T, *world.bounds[:, 1, :2].T)
    (near, _), aside = track.tree.query_nearest(
        boxes, max_distance=radius + _NEAR, return_distance=True, all_matches=False
    )
    above = np.maximum(world.bounds[near, 0, 2] - band[1], band[0] - world.bounds[near, 1, 2])
    least = np.hypot(np.maximum(aside - radius, 0), np.maximum(above, 0))  # no element is nearer than its box
    caught = {(v.global_id, v.leg) for v in found if v.kind == "footprint"}
    clearance = _NEAR
    for k in np.argsort(least, kind="stable"):
        if least[k] > 0 and least[k] >= clearance:
            break
        element = world.elements[near[k]]
        body = body_of(element)
        if body is None:
            continue
        met = _meets(track, body, swept, facets, radius, band) if least[k] == 0 else {}
        clearance = 0.0 if met else min(clearance, _distance(swept, body.collider))
        for leg, (kind, piece, place) in met.items():
            if (element.global_id, leg) in caught:
                continue
            gap = _distance(_swept(track.pieces[[piece]], 0.0, *band)[0], body.collider)
            depth = world.radius + gap if kind == "inside" else max(world.radius - gap, 0.0)
            owner = element.global_id, element.name
            verb = "is wholly inside" if kind == "inside" else "meets"
            found.append(track.refusal(kind, f"the robot's body {verb} {who(owner)}", place, depth, leg, owner))
    return clearance if clearance < _NEAR else math.inf


def _meets(
    track: Track, body: Body, swept: fcl.CollisionObject, facets: int, radius: float, band: tuple[float, float]
) -> dict[int | None, tuple[Kind, int, NDArray[np.float64]]]:
    """Return, for every leg that meets an element: how, on which piece, and where.

    Surfaces that do not cross leave two ways to meet: a part of the element lies wholly in the swept
    body, or a stretch of the swept body wholly in the element. The collision library sees neither.
    """
    met: dict[int | None, tuple[Kind, int, NDArray[np.float64]]] = {}
    result = fcl.CollisionResult()
    fcl.collide(swept, body.collider, fcl.CollisionRequest(num_max_contacts=_CONTACTS, enable_contact=True), result)
    for contact in result.contacts:
        piece = contact.b1 // facets
        if track.leg_of(piece) not in met:
            facet = shapely.convex_hull(shapely.multipoints(body.vertices[body.faces[contact.b2], :2]))
            place = shapely.get_coordinates(shapely.shortest_line(track.lines[piece], facet))[0]
            met[track.leg_of(piece)] = "body", piece, place
    heights = body.vertices[:, 2]
    corners = body.vertices[(band[0] <= heights) & (heights <= band[1]), :2]
    for corner, piece in track.tree.query(shapely.points(corners), predicate="dwithin", distance=radius).T:
        met.setdefault(track.leg_of(piece), ("body", int(piece), corners[corner]))
    for number, leg in enumerate(track.legs):
        piece = int(np.searchsorted(track.stretch, number))
        start = track.pieces[piece, 0]
        if leg not in met and any(_is_inside(np.array([*start, sum(band) / 2]), solid) for solid in body.solids):
            met[leg] = "inside", piece, start
    return met


def _swept(pieces: NDArray[np.float64], radius: float, low: float, high: float) -> tuple[fcl.CollisionObject, int]:
    """Return what an upright cylinder sweeps on straight pieces, and the number of triangles of each.

    A cylinder that moves sideways sweeps a prism over two half circles and the sides between them: exact
    but for the chords of the circles. A body without width sweeps an upright sheet.
    """
    outline = pieces
    if radius > 0:
        along = pieces[:, 1] - pieces[:, 0]
        length = np.hypot(*along.T)[:, None]
        along = np.divide(along, length, out=np.tile([1.0, 0.0], (len(along), 1)), where=length > 0)
        across = along[:, ::-1] * (-1.0, 1.0)
        turn = np.linspace(-math.pi / 2, math.pi / 2, _HALF_TURN + 1)[:, None]
        arc = radius * (np.cos(turn) * along[:, None] + np.sin(turn) * across[:, None])
        outline = np.concatenate([pieces[:, 1:] + arc, pieces[:, :1] - arc], axis=1)
    count = outline.shape[1]
    vertices = np.empty((len(pieces), 2, count, 3))
    vertices[..., :2] = outline[:, None]
    vertices[..., 2] = np.array([[low], [high]])
    i, j, k = np.arange(count), np.roll(np.arange(count), -1), np.arange(1, count - 1)
    sides = np.concatenate([np.stack([i, j, i + count], axis=1), np.stack([j, j + count, i + count], axis=1)])
    bottom = np.stack([np.zeros_like(k), k + 1, k], axis=1)
    facets = np.concatenate([sides, bottom, bottom[:, ::-1] + count])
    faces = facets + 2 * count * np.arange(len(pieces))[:, None, None]
    return _collider(vertices.reshape(-1, 3), faces.reshape(-1, 3)), len(facets)


def _is_inside(point: NDArray[np.float64], triangles: NDArray[np.float64]) -> bool:
    """Tell whether a surface winds around a point: by the solid angles of van Oosterom and Strackee (1983)."""
    if not ((triangles.min(axis=(0, 1)) <= point) & (point <= triangles.max(axis=(0, 1)))).all():
        return False
    a, b, c = (triangles - point).transpose(1, 0, 2)
    to_a, to_b, to_c = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    ab, bc, ca = (a * b).sum(axis=1), (b * c).sum(axis=1), (c * a).sum(axis=1)
    volume = (a * np.cross(b, c)).sum(axis=1)
    half_angles = np.arctan2(volume, to_a * to_b * to_c + ab * to_c + bc * to_a + ca * to_b)
    return abs(float(half_angles.sum())) > math.pi  # once around is 2 pi


def _distance(one: fcl.CollisionObject, other: fcl.CollisionObject) -> float:
    return max(float(fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult())), 0.0)
