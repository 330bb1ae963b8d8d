"""The report of a study: an HTML page with tables and figures.

Begin with `results`, the data shared by all sections, then `sections`, with a module or
package per heading; `findings` writes their numbers to fits.json, `drawing` makes the
figures, `page` writes the folder.
"""
