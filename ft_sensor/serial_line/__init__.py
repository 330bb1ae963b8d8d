"""serial_line."""
