"""Random numbers by number: the i-th row is the same whoever draws it, and whatever came before."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from workbench.sensitivity.vectorised import Array

Words = npt.NDArray[np.uint64]

# One step of the Philox counter makes four words.
_PER_STEP = 4
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)


def words(seed: int, start: int, shape: tuple[int, int]) -> Words:
    """Rows start .. start + shape[0] - 1 of a table of random 64-bit words, shape[1] per row.

    The table depends on `seed` alone. Philox, a counter-based generator: Salmon, Moraes, Dror,
    Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
    """
    rows, width = shape
    steps = -(-width // _PER_STEP)
    key = np.random.SeedSequence(seed).generate_state(2, np.uint64)
    generator = np.random.Philox(key=key)
    generator.advance(start * steps)
    return generator.random_raw((rows, steps * _PER_STEP))[:, :width]


def unit(values: Words) -> Array:
    """Uniform numbers in [0, 1) from words: their upper 53 bits."""
    return (values >> np.uint64(11)).astype(np.float64) * 2.0**-53


def uniforms(seeds: Words, count: int) -> Array:
    """(N, count) numbers in [0, 1), row i from seeds[i] alone.

    SplitMix64: Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014.
    """
    with np.errstate(over="ignore"):
        z = seeds[:, None] + _GOLDEN * np.arange(1, count + 1, dtype=np.uint64)
        z = (z ^ (z >> np.uint64(30))) * _FIRST
        z = (z ^ (z >> np.uint64(27))) * _SECOND
        return unit(z ^ (z >> np.uint64(31)))
