"""Recorded sessions to reports and exports.

`sessions` chooses and analyses, `truth_errors` holds simulated sessions against their
truth, `export` writes tables. Begin with `sessions`.
"""
