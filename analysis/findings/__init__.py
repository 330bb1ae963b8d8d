"""Everything a report shows, computed once and free of layout.

`findings` joins the results of a study with trends, residuals, surfaces and the health
of the rig and writes them as plain values. Begin with `findings`.
"""
