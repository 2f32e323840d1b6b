"""Sweeps of gains: a study file in, one row per gains and case out, a decision at the end."""
