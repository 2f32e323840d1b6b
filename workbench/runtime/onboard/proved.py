"""Which bundles may move a car: those whose tubes are more than runs that were sampled."""

from __future__ import annotations

from workbench.claims import Rigor
from workbench.errors import InputError
from workbench.runtime.contents import Manifest
from workbench.runtime.onboard.states import Mode


def check_proved(manifest: Manifest, mode: Mode) -> None:
    """Raise InputError for a SAMPLED bundle in a mode that commands the car, or that lets another
    controller command it; SHADOW only listens, and takes every bundle."""
    if mode is not Mode.SHADOW and manifest.rigor is Rigor.SAMPLED:
        raise InputError(
            f"expected a bundle whose tubes are proved for mode {mode.name.lower()}, got rigor "
            f"{manifest.rigor.name} (tubes: {manifest.tubes}): what was learned from runs is no "
            "proof; use --mode shadow, or build the bundle without --learned"
        )
