"""CAN frames of the motor controllers (pucks), and the link that carries them.

`frames` is the codec without I/O, `link` the bus above any transport, `properties` and
`property_client` the property table of a puck, `log` and `decoder` the bus log and its
translation to text.
"""
