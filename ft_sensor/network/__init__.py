"""A sensor on the network: datagrams of one address, whole or not at all.

`datagrams` is the port, in the place of a serial one: what comes from its sensor in the
right size is handed over, in the order of arrival. Begin there.
"""
