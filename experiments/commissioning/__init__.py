"""The first day of an arm, step by step: what is measured, and the record of it."""
