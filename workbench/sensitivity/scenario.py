"""What independent samples prove about the next one: scenario bounds and the binomial limit."""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.special import betainc, betaincc, betainccinv, gammaln, xlog1py, xlogy

from workbench.errors import InputError


def pairs_needed(epsilon: float, *, delta: float, parameters: int) -> int:
    """Smallest N with sum_{i < d} C(N, i) eps^i (1 - eps)^(N - i) <= delta, d = `parameters`.

    Source: Campi and Garatti, "The exact feasibility of randomized solutions of uncertain convex
    programs", SIAM J. Optim. 19(3), 2008.

    >>> pairs_needed(1e-3, delta=1e-6, parameters=2)
    16681
    """
    _check(epsilon, delta, parameters)
    return _smallest(parameters, lambda n: _at_most(parameters - 1, n, epsilon) <= delta)


def violation_bound(pairs: int, *, delta: float, parameters: int) -> float:
    """Smallest epsilon that `pairs` samples support with confidence 1 - delta; 1 if none."""
    _check(0.5, delta, parameters)
    if pairs < parameters:
        return 1.0
    epsilon = float(betainccinv(parameters, pairs - parameters + 1, delta))
    while epsilon < 1.0 and _at_most(parameters - 1, pairs, epsilon) > delta:
        epsilon = math.nextafter(epsilon * (1.0 + 1e-12), math.inf)
    return min(epsilon, 1.0)


def judged_bound(pairs: int, *, delta: float, support: int) -> float:
    """epsilon(k) of wait-and-judge for k = `support` pairs that carry the solution; 1 if none.

    1 - epsilon is the root t of delta / (N + 1) sum_{m = k}^{N} C(m, k) t^(m - k) = C(N, k) t^(N -
    k), N = `pairs`; summed up, with B binomial(N + 1, epsilon): delta P(B > k) = (k + 1) P(B = k +
    1). Rounded up. Holds for whatever k turns out to be. Source: Campi and Garatti, "Wait-and-judge
    scenario optimization", Math. Program. 167, 2018; without its condition that no two sets of
    pairs carry the same solution: Campi and Garatti, "Compression, generalization and learning",
    JMLR 24, 2023, whose epsilon is no larger.

    >>> round(judged_bound(1000, delta=1e-6, support=2), 4)
    0.0222
    """
    if support < 0:
        raise InputError(f"expected a number of pairs >= 0 as support, got {support}")
    _check(0.5, delta, support + 1)
    if pairs <= support:
        return 1.0
    low, high = 0.0, 1.0
    # P(B = k + 1) / P(B > k) falls from 1 to 0 as epsilon grows.
    while (middle := 0.5 * (low + high)) not in (low, high) and high - low > 1e-12 * high:
        if _log_ratio(middle, pairs + 1, support + 1) > math.log(delta / (support + 1)):
            low = middle
        else:
            high = middle
    return min(1.0, high * (1.0 + 1e-9))


def _log_ratio(epsilon: float, trials: int, successes: int) -> float:
    """ln (P(B = successes) / P(B >= successes)), B binomial(trials, epsilon)."""
    choices = gammaln(trials + 1.0) - gammaln(successes + 1.0) - gammaln(trials - successes + 1.0)
    exact = choices + xlogy(successes, epsilon) + xlog1py(trials - successes, -epsilon)
    tail = float(betainc(successes, trials - successes + 1, epsilon))
    # Where the tail leaves the doubles, its first term is all of it.
    return float(exact) - math.log(tail) if tail > 0.0 else 0.0


def judged_pairs_needed(epsilon: float, *, delta: float, support: int) -> int:
    """Smallest number of pairs for which `judged_bound` is at most epsilon with this support."""
    _check(epsilon, delta, support + 1)
    return _smallest(
        support + 1, lambda n: judged_bound(n, delta=delta, support=support) <= epsilon
    )


def hold_out_bound(violations: int, *, pairs: int, delta: float) -> float:
    """Upper limit of a probability after `violations` in `pairs` fresh trials; 1 if none.

    Smallest epsilon with P(B <= violations) <= delta, B binomial(pairs, epsilon). Source: Clopper
    and Pearson, Biometrika 26(4), 1934 (one-sided).
    """
    if not 0 <= violations <= pairs:
        raise InputError(f"expected 0 <= violations <= pairs, got {violations} of {pairs}")
    return violation_bound(pairs, delta=delta, parameters=violations + 1)


def _at_most(successes: int, trials: int, epsilon: float) -> float:
    """P(B <= successes), B binomial(trials, epsilon); of any number of trials."""
    return (
        1.0 if successes >= trials else float(betaincc(successes + 1, trials - successes, epsilon))
    )


def _smallest(first: int, enough: Callable[[int], bool]) -> int:
    """The smallest n >= first for which the monotone `enough` holds."""
    low, high = first - 1, first
    while not enough(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def _check(epsilon: float, delta: float, parameters: int) -> None:
    if not (0.0 < epsilon < 1.0 and 0.0 < delta < 1.0 and parameters >= 1):
        raise InputError(
            "expected 0 < epsilon < 1, 0 < delta < 1 and at least one parameter, "
            f"got epsilon={epsilon!r}, delta={delta!r}, parameters={parameters!r}"
        )
