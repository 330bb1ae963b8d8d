"""A sensor on a serial port: bytes to dated samples.

`link` imports pyserial, `framing` finds frames in damaged bytes, `timestamps`
dates samples by the sensor's own counter, `sensor` is a `WrenchSensor` of any make and
`reconnect` opens it again after it was unplugged. Begin with `sensor`.
"""
