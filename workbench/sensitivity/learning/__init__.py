"""Learning how far runs spread: pairs of runs, forms fitted to them, what they support."""
