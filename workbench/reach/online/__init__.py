"""The online tube: what its compiled loop calls, and the proof that its numbers bound."""
