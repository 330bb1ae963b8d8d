"""What runs inside the emulated machine: scenarios, and what they are made of.

`__main__` runs them one after the other; `machine_room` is what each gets.
"""
