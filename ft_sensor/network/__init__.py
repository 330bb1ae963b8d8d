"""A sensor on the network: UDP datagrams of one address.

`datagrams` replaces the serial port: it delivers datagrams of the right size from the
sensor's address in order of arrival. Begin there.
"""
