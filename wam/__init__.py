"""Barrett WAM, seven degrees of freedom: CAN protocol, driver, model, control law.

`bus` is the protocol, `driver` the arm as the control loop sees it, `model` kinematics
and gravity, `control` the joint torques, `calibration` the identification of the arm.
Begin with `driver.arm`.
"""
