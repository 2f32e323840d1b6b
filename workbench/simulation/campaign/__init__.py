"""Surveys of sampled scenarios: drawn, driven by every policy, judged, stored and summed up."""
