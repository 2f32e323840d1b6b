"""The picture of ratios over time names every method, and refuses what does not fit."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs the optional package matplotlib")

from workbench.errors import InputError
from workbench.report.ratios import RatioCurve, ratio_figure

TIMES = np.linspace(0.0, 1.0, 5)


def test_every_method_is_named_in_the_picture_of_its_group() -> None:
    curves = [
        RatioCurve("alpha", "first", np.array([1.0, 2.0, 40.0, 5e3, np.inf])),
        RatioCurve("beta", "first", np.ones(5)),
        RatioCurve("gamma", "second", np.array([np.nan, 1.0, 1.1, 1.2, 1.3])),
    ]
    figure = ratio_figure(TIMES, curves)
    first, second = figure.panels
    assert "alpha" in first
    assert "beta" in first
    assert "log scale" in first
    assert "gamma" not in first
    assert "gamma" in second
    assert "log scale" not in second
    assert figure.numbers is not None
    assert [row[0] for row in figure.numbers.rows] == ["alpha", "beta", "gamma"]
    assert "∞" in figure.html()


def test_a_method_without_any_finite_ratio_is_still_in_the_legend() -> None:
    figure = ratio_figure(TIMES, [RatioCurve("alpha", "first", np.full(5, np.inf))])
    assert "alpha" in figure.panels[0]


def test_ratios_of_another_length_are_refused() -> None:
    with pytest.raises(InputError, match="ratios of 'alpha'"):
        ratio_figure(TIMES, [RatioCurve("alpha", "first", np.ones(4))])
