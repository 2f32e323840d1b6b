"""Symbolic models to C, and C to a bundle for the vehicle."""

from workbench.codegen.bundle import MonitorSpec, build_bundle

__all__ = ["MonitorSpec", "build_bundle"]
