"""Reports: from recorded sessions or external tables to a study and its page.

`sessions` and `external_tables` load and fit the trials, `study_report` writes the
page of either. Begin with `study_report`.
"""
