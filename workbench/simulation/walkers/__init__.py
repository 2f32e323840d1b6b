"""People of a scenario: where they really are, step by step."""
