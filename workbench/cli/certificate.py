"""`--certificate FILE` of `workbench derive`: writes a bound for the independent checker."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from workbench.checker.arithmetic import UnprovedError
from workbench.checker.claims import check
from workbench.cli.analysis_options import add_file_option
from workbench.cli.common import write_text
from workbench.errors import InputError

if TYPE_CHECKING:
    from workbench.models.system import System
    from workbench.sensitivity import Discrepancy

# Shares by which rates are raised until the checker, which encloses the Jacobian by expressions of
# its own, can show them.
_SLACKS: Final = (1e-9, 1e-6, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1)


def add_certificate_option(parser: argparse.ArgumentParser) -> None:
    """Add `--certificate FILE`."""
    add_file_option(
        parser,
        "--certificate",
        text="write the tightest formula over the region, not the recommended tube, as a "
        "certificate for `workbench check`; with --over tube it is about one initial set, tighter",
    )


def write_certificate(
    file: Path,
    system: System,
    bound: Discrepancy,
    *,
    initial_radius: Mapping[str, float],
    instants_s: Sequence[float],
) -> float:
    """Write the certificate of a proved bound; the share by which its rates had to be raised.

    The file is written only when the independent checker accepts it, with the least of a row of
    raises. Raises InputError where it accepts none of them, or the bound has no certificate.
    """
    from workbench.reach.certified.certificate import certificate_text, spread_certificate

    refusal = ""
    for slack in _SLACKS:
        document = spread_certificate(
            system, bound, initial_radius=initial_radius, instants_s=instants_s, slack=slack
        )
        text = certificate_text(document)
        try:
            check(text.encode())
        except (UnprovedError, ValueError) as error:
            refusal = str(error)
        else:
            write_text(file, text)
            return slack
    raise InputError(
        f"the independent checker cannot show this bound ({refusal}); derive it with more cells "
        "(fewer where it is too much work), or certify another method"
    )
