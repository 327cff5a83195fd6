"""A certificate: margins, and how they are shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    pass

__all__ = [
    "SAMPLE",
    "STATE_TOLERANCE",
    "Certificate",
    "CertificateRow",
    "at_least",
    "at_most",
    "format_certificate",
]

TOLERANCE = 1e-6  # result.json holds control points to 1e-12, a solver keeps its constraints to 1e-6
SAMPLE = 1e-3  # [s]
STATE_TOLERANCE = 1e-3  # [m], [rad] and [m/s] by which the solution file may differ from the curve


@dataclass(frozen=True)
class CertificateRow:
    """One margin.

    Attributes
    ----------
    name : str
    value, limit : float
        What was measured and what it is held against, in ``unit``.
    margin : float
        How far the value is on the good side of its limit; negative where it is violated.
    ok : bool
    how : str
        ``exact`` (at every time), ``sampled`` (every millisecond) or ``official``.
    unit : str
    """

    name: str
    value: float
    limit: float
    margin: float
    ok: bool
    how: str
    unit: str = ""


@dataclass(frozen=True)
class Certificate:
    """All margins of one result.

    Attributes
    ----------
    folder : Path
    scenario, backend, status : str
    f_ttr : float or None
        From where on the repaired curve is driven [s].
    rows : tuple of CertificateRow
    """

    folder: Path
    scenario: str
    backend: str
    status: str
    f_ttr: float | None
    rows: tuple[CertificateRow, ...]

    @property
    def ok(self) -> bool:
        """No margin is violated."""
        return all(row.ok for row in self.rows)


def format_certificate(certificate: Certificate) -> str:
    """The certificate as a table for people."""
    lines = [
        f"{certificate.scenario}, backend {certificate.backend}, status {certificate.status}"
        + (f", F-TTR {certificate.f_ttr:g} s" if certificate.f_ttr is not None else "")
    ]
    width = max(len(row.name) for row in certificate.rows)
    lines.append(f"{'':{width}}  {'value':>10}  {'limit':>10}  {'margin':>10}  {'':8}  how")
    for row in certificate.rows:
        verdict = "ok" if row.ok else "VIOLATED"
        value, limit, margin = map(_figure, (row.value, row.limit, row.margin))
        how = f"{row.how}, {row.unit}" if row.unit else row.how
        lines.append(f"{row.name:{width}}  {value}  {limit}  {margin}  {verdict:8}  {how}")
    broken = [row.name for row in certificate.rows if not row.ok]
    lines.append("certified: every margin is kept" if not broken else f"NOT certified: {', '.join(broken)}")
    return "\n".join(lines)


def _figure(x: float) -> str:
    """Four decimals, unless these would show nothing of it."""
    return f"{x:10.1e}" if 0.0 < abs(x) < 5e-5 else f"{x + 0.0:10.4f}"


# -- rows --------------------------------------------------------------------------------------------


def at_most(
    name: str, value: float, limit: float, how: str, unit: str, tolerance: float = TOLERANCE
) -> CertificateRow:
    """A row whose value may not be above its limit."""
    return CertificateRow(name, value, limit, limit - value, value <= limit + tolerance, how, unit)


def at_least(
    name: str, value: float, limit: float, how: str, unit: str, tolerance: float = TOLERANCE
) -> CertificateRow:
    """A row whose value may not be below its limit."""
    return CertificateRow(name, value, limit, value - limit, value >= limit - tolerance, how, unit)
