"""Tubes of loops whose controller runs at samples and holds its commands in between."""
