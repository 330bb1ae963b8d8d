"""What the operator does: commands, sessions, trials."""
