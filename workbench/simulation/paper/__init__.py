"""The paper's evaluation: drives replayed offline, tubes from what was measured, counts."""
