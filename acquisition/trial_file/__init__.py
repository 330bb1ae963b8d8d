"""Trial files: one MCAP file per trial, written once, verified, never changed."""
