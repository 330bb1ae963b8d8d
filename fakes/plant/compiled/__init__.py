"""The simulated arm as a record of plain numbers, moved by compiled functions.

`motion` is links and dynamics, `drives` friction and stops, `substeps` puts them
together, `body` and `gauges` are what the plant sees. Begin with `body`.
"""
