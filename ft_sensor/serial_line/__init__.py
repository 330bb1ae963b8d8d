"""A sensor on a serial port: from bytes to timestamped samples.

`link` imports pyserial, `framing` finds frames in damaged data, `timestamps` dates
samples by the sensor's counter, `sensor` implements `WrenchSensor` for any make and
`reconnect` reopens it after it was unplugged. Begin with `sensor`.
"""
