"""Barrett WAM, seven degrees of freedom: CAN protocol, driver, model, control law.

`bus` speaks the protocol, `driver` is the arm as the loop sees it, `model` its
kinematics and gravity, `control` the torques, `calibration` what is measured of it.
Begin with `driver.arm`.
"""
