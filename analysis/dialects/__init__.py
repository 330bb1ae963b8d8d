"""Text tables of other programs: what is written how in a file, and its numbers.

Begin with `reading.read_text_table`: it finds encoding, lines before the header,
delimiter, header, row of units and decimal mark, and gives the rows. Whatever does not
fit is refused with file, line, column, what stands there and what was expected.
"""
