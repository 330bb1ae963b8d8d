"""control_loop."""
