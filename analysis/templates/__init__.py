"""Templates of the report page.

`analysis.report.page` fills them.
"""
