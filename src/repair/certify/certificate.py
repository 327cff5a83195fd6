"""A certificate: margins, and how they are shown."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import Any

__all__ = [
    "SAMPLE",
    "STATE_TOLERANCE",
    "TOLERANCE",
    "Certificate",
    "CertificateRow",
    "as_table",
    "at_least",
    "at_most",
    "equal",
    "format_certificate",
    "said",
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
        ``exact`` (at every time), ``continuous`` (at every time, by a bound on the motion), ``sampled``
        (every millisecond), ``files`` (the files against each other and the scenario), ``recomputed``,
        ``searched again``, or ``official`` (the drivability checker's answer).
    unit : str
        Or a remark.
    claim : bool
        False for what is only told, and cannot be violated.
    """

    name: str
    value: float
    limit: float
    margin: float
    ok: bool
    how: str
    unit: str = ""
    claim: bool = True


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
    judged_under : tuple of str
        What the result was judged by, in words.
    weaker : tuple of str
        What of that allows more than is usual. Everything is measured here all the same.
    traffic : str
        How many obstacles there are, who was left out, and whom the search's own reading was taken of.
    """

    folder: Path
    scenario: str
    backend: str
    status: str
    f_ttr: float | None
    rows: tuple[CertificateRow, ...]
    judged_under: tuple[str, ...] = ()
    weaker: tuple[str, ...] = ()
    traffic: str = ""

    @property
    def ok(self) -> bool:
        """No margin is violated."""
        return not self.broken

    @property
    def broken(self) -> tuple[str, ...]:
        """Names of the rows that are violated."""
        return tuple(row.name for row in self.rows if row.claim and not row.ok)


def format_certificate(certificate: Certificate) -> str:
    """The certificate as a table for people."""
    lines = [
        f"{certificate.scenario}, backend {certificate.backend}, status {certificate.status}"
        + (f", F-TTR {certificate.f_ttr:g} s" if certificate.f_ttr is not None else "")
    ]
    if certificate.judged_under:
        words = f"judged under {', '.join(certificate.judged_under)}"
        lines += fill(words, 100, subsequent_indent="  ").splitlines()
    if certificate.traffic:
        lines.append(f"traffic: {certificate.traffic}")
    if certificate.weaker:
        lines.append(f"WEAKER than usual: {', '.join(certificate.weaker)}")
    width = max(len(row.name) for row in certificate.rows)
    lines.append(f"{'':{width}}  {'value':>10}  {'limit':>10}  {'margin':>10}  {'':8}  how")
    for row in certificate.rows:
        verdict = _verdict(row)
        value, limit, margin = map(_figure, (row.value, row.limit, row.margin))
        how = f"{row.how}, {row.unit}" if row.unit else row.how
        lines.append(f"{row.name:{width}}  {value}  {limit}  {margin}  {verdict:8}  {how}")
    lines.append(_sentence(certificate))
    return "\n".join(lines)


def as_table(certificate: Certificate) -> dict[str, Any]:
    """The certificate for a page: its sentence, and its rows as words."""
    rows = [
        [
            row.name, *(_figure(x).strip() for x in (row.value, row.limit, row.margin)),
            _verdict(row), f"{row.how}, {row.unit}" if row.unit else row.how,
        ]
        for row in certificate.rows
    ]  # fmt: skip
    return {"sentence": _sentence(certificate), "rows": rows}


def _verdict(row: CertificateRow) -> str:
    return "told" if not row.claim else "ok" if row.ok else "VIOLATED"


def _sentence(certificate: Certificate) -> str:
    if certificate.broken:
        return f"NOT certified: {', '.join(certificate.broken)}"
    if certificate.weaker:
        return "certified: every margin is kept, but what the result was judged under is weaker than usual"
    return "certified: every margin is kept"


def _figure(x: float) -> str:
    """Four decimals, unless these would show nothing of it; a dash for what is no number."""
    if x != x:
        return f"{'-':>10}"
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


def equal(name: str, value: float, wanted: float, how: str) -> CertificateRow:
    """A row whose value has to be what is wanted, such as a number of states."""
    return CertificateRow(
        name, float(value), float(wanted), -abs(float(value) - float(wanted)), value == wanted, how
    )


def said(name: str, yes: bool, how: str, remark: str = "", *, claim: bool = True) -> CertificateRow:
    """A row that is a yes or a no."""
    return CertificateRow(name, float(yes), 1.0, float(yes) - 1.0, yes, how, remark, claim)
