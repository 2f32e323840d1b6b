"""The paper's way to a tube: simulations bloated by a learned bound. Rigor SAMPLED."""
