"""Recorded sessions, or tables from elsewhere, to studies and their pages.

`sessions` and `external_tables` load the trials and fit them, `study_report` makes the
page of either. Begin with `study_report`.
"""
