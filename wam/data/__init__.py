"""Constants of the arm as TOML."""
