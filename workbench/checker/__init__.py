"""Checks certificates on its own: standard library only, nothing of the code that derives them."""
