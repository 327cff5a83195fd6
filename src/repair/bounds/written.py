"""Proofs as plain values, compactly: what a certificate is checked from."""

from __future__ import annotations

import gzip
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from repair.bounds.forbidden import pieces
from repair.bounds.latest import Bound, Proof

__all__ = ["PROOF_FILE", "proof_bytes", "proofs_to_dict"]

PROOF_FILE = "bound.json.gz"


def proofs_to_dict(bounds: Mapping[str, Bound]) -> dict[str, Any]:
    """All proofs; docs/bound.md has the form."""
    return {"schema": 1, "kinds": {k: _proof(b.proof) for k, b in bounds.items() if b.proof is not None}}


def proof_bytes(bounds: Mapping[str, Bound]) -> bytes:
    """The same, as a file: byte for byte the same each time."""
    text = json.dumps(proofs_to_dict(bounds), separators=(",", ":"), allow_nan=False)
    return gzip.compress(text.encode(), mtime=0)


def _proof(proof: Proof) -> dict[str, Any]:
    motions, cuts = proof.motions, proof.attempt.cuts
    return {
        "t_bound_s": proof.time,
        "start": {
            "position_m": motions.position.tolist(),
            "velocity_mps": motions.velocity.tolist(),
            "heading_rad": motions.heading,
            "yaw_rate_radps": motions.yaw_rate,
        },
        "instants_s": [round(t, 9) for t in proof.instants.tolist()],
        "places": [
            {
                "instant": cut.instant,
                "obstacle": obstacle,
                "shape": _distinct(shape),
                "headings": [cut.low, cut.high],
                "pieces": pieces(cut.low, cut.high),
                "corners": cut.corners.tolist(),
            }
            for cut, shape, obstacle in zip(cuts, proof.attempt.shapes, proof.obstacles, strict=True)
        ],
        "tree": proof.attempt.tree,
    }


def _distinct(shape: np.ndarray[Any, Any]) -> list[list[float]]:
    """Corners without the repeated ones."""
    kept = np.any(shape != np.roll(shape, 1, axis=0), axis=1)
    return [[float(x), float(y)] for x, y in shape[kept]]
