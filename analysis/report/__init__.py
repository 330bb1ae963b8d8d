"""The report: the results of a study, the sections that show them, and the page.

`results` has every number, `sections` a module or package for each heading, `drawing`
makes the figures, `page` writes the folder. Begin with `sections`.
"""
