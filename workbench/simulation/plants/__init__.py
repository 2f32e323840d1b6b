"""Cars that the analysis did not write: what moves, and what moves it."""
