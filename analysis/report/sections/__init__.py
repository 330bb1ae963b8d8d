"""The sections of a report, each a module or a package named by its heading.

A section is one value: its heading, its tables, its figures with their captions, and
beside them the numbers that they show. `order` has them as they stand on the page.
"""
