"""What an analysis says of an UNPROVED separation: proved, refuted by a witness, undecided."""
