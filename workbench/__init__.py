"""Proved spread of vehicle closed loops, and the monitor compiled from the proof.

Importing this package loads nothing heavy; pick the layer you need, for example
``workbench.runtime`` (base install) or ``workbench.reach`` (extra ``analysis``).
"""

__version__ = "0.1.0"
