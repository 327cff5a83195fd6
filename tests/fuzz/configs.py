"""Configurations that are extreme, wrong, or none."""

from __future__ import annotations

import random
from typing import Any

import yaml

from repair.config.schema import configuration_keys, words_of

KEYS = configuration_keys()
WORDS = {key.name: words for key in KEYS if (words := words_of(key))}
LISTS = {key.name for key in KEYS if isinstance(key.default, list)}
RANGES = {key.name: key for key in KEYS if key.setting.low is not None and key.setting.high is not None}
# These need something else that goes with them.
NOT_ALONE = ("reference.source", "casadi.solver")

ODD_CONFIG = (
    "nan", ".nan", ".inf", "-.inf", "null", "~", "true", "[]", "{}", "[1, 2]", "{a: {b: [c]}}", "''", "text",
    "-1", "0", "1e300", "-1e300", "1e-300", "99999999999999999999", "2001-01-01", "0x10", "1:30",
    "${search.delta_t}", "${missing}", "${", "???", "!!python/object:os.system x", "!!binary aGk=",
    "*unknown", "'\\x00'",
)  # fmt: skip


def config_text(rng: random.Random, name: str) -> bytes:
    """A YAML file: ``extremes`` is valid, ``types`` has wrong types and keys, ``garbage`` is anything."""
    if name == "extremes":
        return yaml.safe_dump(_nested(dict(_extreme(rng) for _ in range(rng.randrange(1, 4))))).encode()
    if name == "types":
        keys = rng.sample([*(key.name for key in KEYS), "search", "nothing.here", "seed"], 2)
        lines = []
        for key in keys:
            *sections, last = key.split(".")
            lines += ["  " * depth + f"{section}:" for depth, section in enumerate(sections)]
            lines.append("  " * len(sections) + f"{last}: {rng.choice(ODD_CONFIG)}")
        return "\n".join(lines).encode()
    return _garbage(rng)


def _extreme(rng: random.Random) -> tuple[str, object]:
    if rng.random() < 0.2:
        name = rng.choice([k for k in sorted(WORDS) if k not in NOT_ALONE])
        word = rng.choice(WORDS[name])
        return name, [word] if name in LISTS else word
    name = rng.choice([k for k in sorted(RANGES) if not k.startswith(("casadi", "qptr"))])
    key = RANGES[name]
    low, high = key.setting.low, key.setting.high
    assert low is not None
    assert high is not None
    value = rng.choice([low, high, low + 0.1 * (high - low), low + 0.01 * (high - low)])
    return name, int(value) if key.type.startswith("int") else float(value)


def _nested(flat: dict[str, object]) -> dict[str, object]:
    made: dict[str, Any] = {}
    for key, value in flat.items():
        *sections, last = key.split(".")
        inner = made
        for section in sections:
            inner = inner.setdefault(section, {})
        inner[last] = value
    return made


def _garbage(rng: random.Random) -> bytes:
    bomb = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    bomb += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 9)]
    return rng.choice(
        [
            b"", b"\n", b"- 1\n- 2\n", b"text", b"7", b"search", b"search:", b"search: [1]", b"\tsearch: 1",
            b"{",
            b"[" * 5000, b"{a: " * 3000, b"a: b: c", b"\xff\xfe\xfd", b"\x00", "\n".join(bomb).encode(),
            b"search: &s\n  delta_t: 0.2\n  <<: *s", b"? [a, b]\n: 1", b"1: 2", b"null: 1", b"search: {1: 2}",
            b"search:\n  delta_t: 0.1\n  delta_t: 0.2", b"--- {}\n--- {}", b"!!set {a}",
            b"!!python/object/apply:os.getcwd []", b"for_backend: {ego: 3}",
            b"for_backend: {ego: {backend: casadi}}",
            b"for_backend: {ego: {for_backend: {ego: {}}}}", b"for_backend: {ego: {search: 1}}",
            b"for_backend: 3",
            b"scenario: [1]", b"backend: [ego]", b"backend: nothing", b"search: ${scene}",
            b"search: {delta_t: '${search.delta_t}'}", b"seed: ${oc.env:HOME}", b"driver: ???", b"<xml/>",
            rng.randbytes(200),
        ]
    )  # fmt: skip
