"""Damage to a file's bytes, and XML that is meant to do harm."""

from __future__ import annotations

import random


def truncate(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def flip_bytes(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.choice([1, 3, 30])):
        damaged[rng.randrange(len(damaged))] = rng.randrange(256)
    return bytes(damaged)


def change_digits(rng: random.Random, data: bytes) -> bytes:
    damaged = bytearray(data)
    digits = [i for i, b in enumerate(data) if b in b"0123456789.-"]
    for i in rng.sample(digits, min(len(digits), rng.choice([5, 50]))):
        damaged[i] = rng.choice(b"0123456789.-e")
    return bytes(damaged)


def delete_span(rng: random.Random, data: bytes) -> bytes:
    start = rng.randrange(len(data))
    return data[:start] + data[start + rng.choice([1, 20, 2000]) :]


def repeat_span(rng: random.Random, data: bytes) -> bytes:
    start = rng.randrange(len(data))
    end = start + rng.choice([1, 20, 2000])
    return data[:end] + data[start:end] + data[end:]


def wrong_encoding(rng: random.Random, data: bytes) -> bytes:
    text = data.decode("utf-8", "replace")
    kind = rng.randrange(6)
    if kind == 0:
        return text.encode("utf-16")
    if kind == 1:
        return data.replace(b"UTF-8", b"no-such-code").replace(b"utf-8", b"no-such-code")
    if kind == 2:
        return data[: len(data) // 2] + b"\xff\xfe\x00\x80" + data[len(data) // 2 :]
    if kind == 3:
        return b"\xef\xbb\xbf" + data
    if kind == 4:
        return data.replace(b">", b">\x00", 3)
    return text.encode("utf-32")


def not_a_scenario(rng: random.Random, data: bytes) -> bytes:
    return rng.choice(
        [b"", b" \n", b"\x00" * 100, b"<html><body/></html>", b"{}", b"PK\x03\x04", data[::-1],
         b"<commonRoad/>", b"<commonRoad timeStepSize='0.1'/>", data + data, rng.randbytes(500)]
    )  # fmt: skip


def _after_declaration(data: bytes, doctype: bytes) -> bytes:
    end = data.find(b"?>") + 2 if data.lstrip().startswith(b"<?xml") else 0
    return data[:end] + doctype + data[end:]


def _use_entity(data: bytes, name: bytes) -> bytes:
    at = data.find(b"</x>")
    return data[:at] + b"&" + name + b";" + data[at:] if at > 0 else data


def entity_bomb(rng: random.Random, data: bytes) -> bytes:
    lines = [b'<!ENTITY e0 "1111111111">'] + [
        b'<!ENTITY e%d "%s">' % (k, b"&e%d;" % (k - 1) * rng.choice([10, 50]))
        for k in range(1, rng.choice([5, 9]))
    ]
    return _use_entity(
        _after_declaration(data, b"<!DOCTYPE x [" + b"".join(lines) + b"]>"), b"e%d" % (len(lines) - 1)
    )


def external_entity(rng: random.Random, data: bytes) -> bytes:
    where = rng.choice(
        [b"file:///etc/hostname", b"file:///dev/zero", b"http://127.0.0.1:9/x", b"nothing.txt"]
    )
    kind = rng.choice([b'<!DOCTYPE x SYSTEM "%s">', b'<!DOCTYPE x [<!ENTITY e SYSTEM "%s">]>',
                       b'<!DOCTYPE x [<!ENTITY %% p SYSTEM "%s"> %%p;]>'])  # fmt: skip
    return _use_entity(_after_declaration(data, kind % where), b"e")


RAW = (
    truncate, flip_bytes, change_digits, delete_span, repeat_span, wrong_encoding, not_a_scenario,
    entity_bomb, external_entity,
)  # fmt: skip
