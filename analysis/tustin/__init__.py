"""tustin."""
