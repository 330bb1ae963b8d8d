"""Figures of the report: what each draws, its caption, its data, its size.

`style` imports matplotlib, `selection` chooses what is drawn, every other module
is one family of figures and ends with their list.
"""
