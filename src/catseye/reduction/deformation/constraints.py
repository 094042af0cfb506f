"""Constraints on movements as blocks of a basis, and what the ranges determine of them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from catseye.errors import InputError
from catseye.estimation.deformation.differential import RANK, allowed_directions, rigid_group

if TYPE_CHECKING:
    from catseye.records.network.movement_constraints import MovementConstraints


@dataclass(frozen=True, eq=False)
class MovementBlock:
    """Points that share parameters of movement.

    kind    "free", "body", "plane", "line" or "still"
    name    of the constraint, or of the free point
    rows    (k,) of its points
    basis   (3k, q) movements that are allowed
    """

    kind: str
    name: str
    rows: np.ndarray
    basis: np.ndarray


def movement_blocks(
    names: tuple[str, ...], x: np.ndarray, constraints: "MovementConstraints | None"
) -> list[MovementBlock]:
    """Blocks of all points, constraints first, then each free point.

    names   of the points
    x       (n, 3) m

    Raises InputError for a name that is none of them, for points of a body on one line, and where no point may move.
    """
    blocks, place = [], {name: k for k, name in enumerate(names)}
    for each in () if constraints is None else constraints.every:
        unknown = [name for name in each.points if name not in place]
        if unknown:
            raise InputError(
                f"constraint {each.name!r}: point {unknown[0]!r} has no range in both epochs (expected one of the "
                f"{len(names)} points measured)"
            )
        rows = np.array([place[name] for name in each.points])
        blocks.append(_block(each, rows, x[rows]))
    constrained_rows = set(np.concatenate([block.rows for block in blocks]).tolist()) if blocks else set()
    blocks += [free_block(names[k], k) for k in range(len(names)) if k not in constrained_rows]
    if not sum(block.basis.shape[1] for block in blocks):
        raise InputError("the constraints let no point move (expected one at least that may)")
    return blocks


def _block(each: object, rows: np.ndarray, x: np.ndarray) -> MovementBlock:
    from catseye.records.network.movement_constraints import LineConstraint, PlaneConstraint, RigidConstraint

    k = len(rows)
    if isinstance(each, RigidConstraint):
        extent = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
        if extent[1] < 1e-6 * extent[0]:
            raise InputError(f"body {each.name!r}: its points lie on one line (expected three off a line)")
        return MovementBlock("body", each.name, rows, rigid_group(x))
    if isinstance(each, PlaneConstraint):
        return MovementBlock("plane", each.name, rows, allowed_directions(k, forbidden=np.array([each.normal])))
    if isinstance(each, LineConstraint):
        return MovementBlock("line", each.name, rows, allowed_directions(k, allowed=np.array([each.along])))
    return MovementBlock("still", str(getattr(each, "name", "")), rows, np.zeros((3 * k, 0)))


def free_block(name: str, row: int) -> MovementBlock:
    """Block of one point that may move anywhere."""
    return MovementBlock("free", name, np.array([row]), np.eye(3))


def joined(blocks: list[MovementBlock], n: int) -> np.ndarray:
    """Basis (3n, q) of the movements of n points."""
    basis = np.zeros((3 * n, sum(block.basis.shape[1] for block in blocks)))
    column = 0
    for block in blocks:
        width = block.basis.shape[1]
        at = (3 * block.rows[:, None] + np.arange(3)).ravel()
        basis[at, column : column + width] = block.basis
        column += width
    return basis


def split_observable(design: np.ndarray, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Movements that the ranges determine (3n, r), and those that they do not (3n, q - r).

    design   (m, q) whitened derivatives of the ranges by the columns of the basis; what is common taken out
    basis    (3n, q)
    """
    length = np.linalg.norm(design, axis=0)
    scale = 1.0 / np.where(length > 0.0, length, 1.0)
    values, vectors = np.linalg.eigh((design * scale).T @ (design * scale))
    observable = values > RANK * max(float(values.max(initial=0.0)), 1e-300)
    turned = basis @ (scale[:, None] * vectors)
    return turned[:, observable], turned[:, ~observable]
