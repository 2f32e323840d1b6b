"""What the nodes of a graph are as exact polynomials, and such polynomials as SX."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import final

import casadi as ca

from workbench.models.atoms import Atoms, Range
from workbench.models.graph import Node
from workbench.models.literals import Literals
from workbench.models.polynomials import Polynomial, TooLargeError

_HIGHEST_POWER = 20


@final
class ExactValues:
    """Translates between nodes, polynomials in canonical `atoms`, and SX expressions.

    inputs: one SX column per function input, the second of them the parameters; ranges: for each of
    their elements where it is known to stay. Constants become symbols of `literals`, so that CasADi
    folds nothing.
    """

    __slots__ = ("_expressions", "_inputs", "_ranges", "_unknown", "atoms", "literals")

    def __init__(
        self, inputs: Sequence[ca.SX], ranges: Sequence[Sequence[Range]], literals: Literals
    ) -> None:
        self.atoms = Atoms()
        self.literals = literals
        self._inputs = inputs
        self._ranges = ranges
        self._unknown: dict[int, ca.SX] = {}
        self._expressions: dict[int, ca.SX] = {}

    def symbol(self, atom: int) -> ca.SX:
        """The SX symbol of an input atom."""
        block, element = self.atoms[atom].key
        return ca.vec(self._inputs[block])[element]

    def is_parameter(self, polynomial: Polynomial) -> bool:
        """Whether it depends on nothing but parameters."""
        inside = [self.atoms[index] for index in self.atoms.within(polynomial)]
        return all(atom.arguments or (atom.name == "input" and atom.key[0] == 1) for atom in inside)

    def of(
        self, index: int, node: Node, operands: Sequence[Polynomial], value: ca.SX
    ) -> Polynomial:
        """The polynomial of node `index`, whose SX is `value`; an atom of its own if too large."""
        try:
            return self._translated(node, operands)
        except TooLargeError:
            self._unknown[index] = value
            return self.atoms.unknown(index)

    def expression(self, polynomial: Polynomial) -> ca.SX:
        """The polynomial as SX. Raises OverflowError for numbers far beyond the doubles."""
        total = ca.SX(0.0)
        for monomial, coefficient in polynomial.terms:
            term = self.literals.exactly(abs(coefficient)) if abs(coefficient) != 1 else None
            for atom, exponent in monomial:
                for factor in [self._atom(atom)] * exponent:
                    term = factor if term is None else term * factor
            if term is None:
                term = self.literals.symbol(1.0)
            total = total + term if coefficient > 0 else total - term
        return total

    def _atom(self, index: int) -> ca.SX:
        if index not in self._expressions:
            self._expressions[index] = self._made(index)
        return self._expressions[index]

    def _made(self, index: int) -> ca.SX:
        atom = self.atoms[index]
        if atom.name == "input":
            return self.symbol(index)
        if atom.name == "unknown":
            return self._unknown[atom.key[0]]
        # CasADi would fold the function of a bare 0 (acos 0) to a rounded double.
        arguments = [
            self.expression(argument) if argument.terms else self.literals.symbol(0.0)
            for argument in atom.arguments
        ]
        if atom.name == "min0":
            return ca.fmin(arguments[0], 0.0)
        operation = getattr(ca, f"OP_{atom.name.upper()}")
        if len(arguments) == 1:
            return ca.SX.unary(operation, arguments[0])
        return ca.SX.binary(operation, arguments[0], arguments[1])

    def _translated(self, node: Node, operands: Sequence[Polynomial]) -> Polynomial:
        if node.constant is not None:
            return Polynomial.number(Fraction(node.constant))
        if node.element is not None:
            block, element = node.element
            return self.atoms.input((block, element), self._ranges[block][element])
        first, last = operands[0], operands[-1]
        match node.name:
            case "add":
                return first + last
            case "sub":
                return first - last
            case "neg":
                return -first
            case "mul":
                return first * last
            case "sq":
                return first * first
            case "twice":
                return first.scaled(Fraction(2))
            case "div":
                return first * self.atoms.function("inv", last)
            case "fmin" | "fmax" | "fabs":
                return self._kink(node.name, first, last)
            case "pow" | "constpow":
                return self._power(first, last)
        return self.atoms.function(node.name, *operands)

    def _kink(self, name: str, first: Polynomial, last: Polynomial) -> Polynomial:
        if name == "fmin":
            return last + self.atoms.function("min0", first - last)
        if name == "fmax":
            return last - self.atoms.function("min0", last - first)
        return first - self.atoms.function("min0", first).scaled(Fraction(2))

    def _power(self, base: Polynomial, exponent: Polynomial) -> Polynomial:
        value = exponent.constant
        if value is not None and value.denominator == 1 and abs(value) <= _HIGHEST_POWER:
            power = base.raised(abs(int(value)))
            return power if value >= 0 else self.atoms.function("inv", power)
        return self.atoms.function("pow", base, exponent)
