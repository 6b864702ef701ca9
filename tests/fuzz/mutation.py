"""Mutations of bytes, of a few kinds and at random places."""

import random
import re

MOST_BYTES = 65_536
EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)
WORDS = (
    *(b"nan", b"inf", b"-inf", b"-1", b"0", b"1", b"1.5", b"1e308", b"1e999", b"-0.0", b"9" * 30, b"1" * 5000),
    *(b"null", b"true", b'""', b'"a"', b"[]", b"[1]", b"[[]]", b"{}", b'{"a": 1}', b"\n", b"\0", b" ", b".."),
    *(b"\xff\xfe", b"\xc2\xb2", b"[" * 5000, b"{a: " * 2000, b"<a>" * 2000, b"-9223372036854775809"),
)
"""Text that readers of numbers and of nested formats have trouble with."""

VALUE = re.compile(rb'(?<=[\s,:\[{(>])(?:"[^"\n]{0,64}"|[^\s,:\]})<"]{1,64})')


def mutations(seeds, n, seed):
    """The seeds, and n inputs made of them; the same for the same arguments."""
    chance = random.Random(seed)
    yield from seeds
    for _ in range(n):
        yield mutated(chance.choice(seeds), seeds, chance)


def mutated(one, seeds, chance):
    """An input made of one, with parts of the seeds."""
    raw = bytearray(one)
    for _ in range(chance.choice((1, 1, 2, 4, 16))):
        chance.choice(KINDS)(raw, seeds, chance)
    return bytes(raw[: max(MOST_BYTES, *map(len, seeds))])


def _place(raw, chance):
    """Headers come first and are short, so half of the places are near the begin."""
    return chance.randrange(min(len(raw), chance.choice((128, len(raw) or 1))) or 1)


def _flip(raw, _, chance):
    if raw:
        raw[_place(raw, chance)] ^= 1 << chance.randrange(8)


def _cut(raw, _, chance):
    del raw[_place(raw, chance) :]


def _remove(raw, _, chance):
    at = _place(raw, chance)
    del raw[at : at + chance.choice((1, 4, 16, 256))]


def _extreme(raw, _, chance):
    size = chance.choice((1, 2, 4, 8))
    order = chance.choice(("little", "big"))
    at = _place(raw, chance)
    raw[at : at + size] = (chance.choice(EXTREMES) & (256**size - 1)).to_bytes(size, order)


def _repeat(raw, _, chance):
    at = _place(raw, chance)
    raw[at:at] = raw[at : at + chance.choice((1, 8, 64, 1024))] * chance.choice((1, 2, 50))


def _splice(raw, seeds, chance):
    other = chance.choice(seeds)
    begin = chance.randrange(len(other) + 1)
    at = _place(raw, chance)
    raw[at : at + chance.choice((0, 16, len(raw)))] = other[begin : begin + chance.choice((16, 256, len(other)))]


def _word(raw, _, chance):
    """Replace a word of the text, if it is a text."""
    at = _place(raw, chance)
    ends = [end for end in (raw.find(c, at, at + 64) for c in b' \n,:"]}<') if end >= 0]
    raw[at : chance.choice((at, min(ends, default=at)))] = chance.choice(WORDS)


def _value(raw, _, chance):
    """A whole value of a text, with its quotes."""
    if found := VALUE.search(raw, chance.randrange(len(raw) or 1)):
        raw[found.start() : found.end()] = chance.choice(WORDS)


KINDS = (_flip, _cut, _remove, _extreme, _repeat, _splice, _word, _value, _value)
