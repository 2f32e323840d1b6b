"""What `learn` and `examine` fit to the pairs, how many they take, and what they may state."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

from workbench.cli.analysis_options import count, seed, share
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.cli.learn_sources import Source
    from workbench.sensitivity.learning.evidence import Evidence
    from workbench.sensitivity.learning.form import Form

FORMS: Final = ("set", "exponential", "piecewise", "matrix")
_PIECES: Final = {"piecewise": 4, "matrix": 6}
_USUAL_PAIRS: Final = 2000
_MOST_PAIRS: Final = 2_000_000
_TRACES: Final = 10
# What the published tool does not have.
_NOT_PUBLISHED: Final = ("form", "pieces", "pairs", "epsilon", "hold_out", "wait_and_judge")


def add_sample_options(parser: argparse.ArgumentParser) -> None:
    """Add form, number of pairs, argument and seed; `chosen_plan` reads them."""
    parser.add_argument(
        "--form", choices=FORMS, metavar="FORM",
        help="set: one exponential per state over the distance in units of the set (default); "
        "exponential: over the state's own distance, as published; piecewise: exponentials joined "
        "in time; matrix: which initial distance moves which state, over time",
    )  # fmt: skip
    parser.add_argument(
        "--pieces", type=count, metavar="N",
        help="in time, of piecewise (default: 4) and matrix (default: 6)",
    )  # fmt: skip
    size = parser.add_mutually_exclusive_group()
    size.add_argument(
        "--pairs", type=count, metavar="N",
        help="pairs of runs (default: 2000; of a folder, all there are)",
    )  # fmt: skip
    size.add_argument(
        "--epsilon", type=share, metavar="E",
        help="take as many pairs as this probability of violation needs",
    )  # fmt: skip
    parser.add_argument(
        "--delta", type=share, default=1e-6, metavar="D",
        help="1 - confidence of the statement (default: 1e-6)",
    )  # fmt: skip
    parser.add_argument(
        "--wait-and-judge", action="store_true",
        help="judge by the pairs that carry the fit, not by the number of its parameters",
    )  # fmt: skip
    parser.add_argument(
        "--hold-out", type=count, metavar="N",
        help="also draw N fresh pairs and count how many leave the bound",
    )  # fmt: skip
    parser.add_argument(
        "--published", action="store_true",
        help="what the published tool DryVR does, defects and all: ten runs, every pair of them, "
        "and no statement",
    )  # fmt: skip
    parser.add_argument(
        "--seed", type=seed, default=1, metavar="N", help="of the random numbers (default: 1)"
    )


@final
@dataclass(frozen=True, slots=True)
class Plan:
    """What is fitted to how many pairs, and what is stated then; fixed before any run.

    fresh: pairs beyond those, for the hold-out.
    """

    form: Form
    count: int
    fresh: int
    evidence: tuple[Evidence, ...]

    @property
    def total(self) -> int:
        """Pairs that are drawn in all."""
        return self.count + self.fresh


def chosen_plan(args: argparse.Namespace, source: Source) -> Plan:
    """What the options ask for. Raises InputError where the source has too few pairs."""
    from workbench.sensitivity.learning.evidence import APriori, HoldOut, WaitAndJudge

    form = _form(args)
    judge: Evidence
    judge = WaitAndJudge(delta=args.delta) if args.wait_and_judge else APriori(delta=args.delta)
    fresh: int = args.hold_out or 0
    evidence: tuple[Evidence, ...] = (judge,)
    if fresh:
        evidence = (judge, HoldOut(delta=args.delta, pairs=fresh))
    parameters = form.parameters(source.pairs.scale)
    pairs = _pairs(args, source, parameters, fresh)
    if pairs + fresh > _MOST_PAIRS:
        raise InputError(
            f"expected at most {_MOST_PAIRS} pairs, got {pairs + fresh}; give fewer --pairs or a "
            "larger --epsilon"
        )
    return Plan(form, pairs, fresh, evidence)


def _pairs(args: argparse.Namespace, source: Source, parameters: int, fresh: int) -> int:
    from workbench.sensitivity.scenario import pairs_needed, violation_bound

    most = source.pairs.most
    if args.epsilon is not None:
        least = violation_bound(_MOST_PAIRS, delta=args.delta, parameters=parameters)
        if args.epsilon < least:
            raise InputError(
                f"expected at most {_MOST_PAIRS} pairs, which give an epsilon of {least:.3g}, and "
                f"--epsilon {args.epsilon:g} needs more; give a larger --epsilon"
            )
        pairs = pairs_needed(args.epsilon, delta=args.delta, parameters=parameters)
    elif args.pairs is not None:
        pairs = args.pairs
    else:
        pairs = _USUAL_PAIRS if most is None else most - fresh
    if most is not None and (pairs + fresh > most or pairs < 1):
        raise InputError(
            f"expected at most the {most} pairs that the recordings give, got {max(pairs, 1)} to "
            f"learn from and {fresh} held out; ask for less, widen --radius or record more"
        )
    return pairs


def _form(args: argparse.Namespace) -> Form:
    from workbench.sensitivity.learning.exponential import GlobalExponential, SetExponential
    from workbench.sensitivity.learning.matrix_form import MatrixForm
    from workbench.sensitivity.learning.piecewise import PiecewiseExponential

    form = args.form or FORMS[0]
    if args.pieces is not None and form not in _PIECES:
        raise InputError(f"--pieces: expected --form piecewise or matrix, got --form {form}")
    pieces = args.pieces or _PIECES.get(form, 1)
    forms: dict[str, Form] = {
        "set": SetExponential(),
        "exponential": GlobalExponential(),
        "piecewise": PiecewiseExponential(pieces),
        "matrix": MatrixForm(pieces),
    }
    return forms[form]


def check_published(args: argparse.Namespace) -> None:
    """Raise InputError for `--published` with what the published tool does not have."""
    for option in _NOT_PUBLISHED if args.published else ():
        if getattr(args, option):
            raise InputError(
                f"expected --published or --{option.replace('_', '-')}, got both; the published "
                f"tool has one form, takes {_TRACES} runs and states nothing"
            )
