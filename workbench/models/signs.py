"""Proofs that an exact polynomial is not negative where other polynomials are not."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.models.atoms import Atoms
from workbench.models.polynomials import Polynomial

_MOST_STEPS = 100


def is_nonnegative(atoms: Atoms, claim: Polynomial, given: Sequence[Polynomial]) -> bool:
    """Whether claim >= 0 is proved wherever every `given` polynomial is >= 0.

    Proved: bounds of the atoms show it; claim = q h with a given h and q >= 0; claim = c h + rest
    with c > 0 and rest >= 0 by the other given ones; or both cases of an atom min(d, 0), equal to
    d where d <= 0 and to 0 where d >= 0. All in rational arithmetic. False means: not proved.
    """
    return _proved(atoms, claim, tuple(given), [_MOST_STEPS])


def resolved(atoms: Atoms, polynomial: Polynomial, given: Sequence[Polynomial]) -> Polynomial:
    """The polynomial with every atom min(d, 0) replaced whose d has a proved sign under `given`."""
    for index in polynomial.atoms:
        if atoms[index].name != "min0":
            continue
        argument = atoms[index].arguments[0]
        if is_nonnegative(atoms, argument, given):
            polynomial = atoms.substituted(polynomial, {index: Polynomial()}, deep=False)
        elif is_nonnegative(atoms, -argument, given):
            polynomial = atoms.substituted(polynomial, {index: argument}, deep=False)
    return polynomial


def _proved(
    atoms: Atoms, claim: Polynomial, given: tuple[Polynomial, ...], budget: list[int]
) -> bool:
    budget[0] -= 1
    if budget[0] < 0:
        return False
    if atoms.bounds(claim)[0] >= 0:
        return True
    return _by_given(atoms, claim, given, budget) or _by_cases(atoms, claim, given, budget)


def _by_given(
    atoms: Atoms, claim: Polynomial, given: tuple[Polynomial, ...], budget: list[int]
) -> bool:
    for k, known in enumerate(given):
        quotient = claim.divided_by(known)
        if quotient is not None and atoms.bounds(quotient)[0] >= 0:
            return True
        others = given[:k] + given[k + 1 :]
        for monomial, weight in known.terms:
            factor = claim.coefficient(monomial) / weight
            if factor > 0 and _proved(atoms, claim - known.scaled(factor), others, budget):
                return True
    return False


def _by_cases(
    atoms: Atoms, claim: Polynomial, given: tuple[Polynomial, ...], budget: list[int]
) -> bool:
    kinks = [index for index in claim.atoms if atoms[index].name == "min0"]
    if not kinks:
        return False
    argument = atoms[kinks[0]].arguments[0]
    for value, condition in ((Polynomial(), argument), (argument, -argument)):
        chosen = {kinks[0]: value}
        known = [atoms.substituted(each, chosen, deep=False) for each in given]
        case = atoms.substituted(claim, chosen, deep=False)
        if not _proved(atoms, case, (*known, condition), budget):
            return False
    return True
