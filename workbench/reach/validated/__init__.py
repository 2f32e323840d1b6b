"""Validated integration: Taylor series in time whose coefficients are polynomials of the set."""
