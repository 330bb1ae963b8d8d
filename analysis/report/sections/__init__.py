"""Sections of a report, each a module or package named after its heading.

A section is a value with heading, tables, figures and captions, next to the code that
computes their numbers. `order` lists the sections in page order.
"""
