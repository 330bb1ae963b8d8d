"""The report: what the sections show of a study, and the page that they stand on.

Begin with `results`, which is what sections share, then `sections`, a module or package
for each heading with its own numbers; `findings` puts them into fits.json, `drawing`
makes the figures, `page` writes the folder.
"""
