"""Tubes of a loop that changes its mode at any time in an interval."""
