"""The report page: sections, tables, figures in order, what-if variants.

`page` writes the folder, `page_model` is what a page consists of, `drawing` makes
the figures. Begin with `page`.
"""
