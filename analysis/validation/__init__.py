"""What a simulated study has to show: bands and the measures they hold.

`bands` lists every band with its source, the other modules compute the measures.
"""
