"""Proved lower bounds on reachable hulls, from validated trajectories."""
