"""pucks."""
