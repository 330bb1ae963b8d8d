"""Barrett WAM on CAN: codec, driver, model, control law."""
