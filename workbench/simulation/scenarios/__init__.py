"""Scenes to drive through: path, people, what sensors miss, and what each policy should do."""
