"""Proofs that are written down for the checker to verify."""
