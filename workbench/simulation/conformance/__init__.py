"""Bounds of errors and disturbances fitted to recorded motion, and what that is worth."""
