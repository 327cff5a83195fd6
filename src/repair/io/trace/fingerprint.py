"""Which file a trace or a verdict is of."""

from __future__ import annotations

import hashlib

__all__ = ["fingerprint"]


def fingerprint(content: bytes) -> str | None:
    """How drawtonomy names the content of a text file.

    Parameters
    ----------
    content : bytes

    Returns
    -------
    str or None
        ``sha256:`` and 64 hexadecimal digits, of the UTF-8 text without a byte order mark and with line feeds
        alone; None where it is no UTF-8, which then has no name.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    return "sha256:" + hashlib.sha256(plain.encode("utf-8")).hexdigest()
