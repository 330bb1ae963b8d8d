"""The arm as the control loop sees it: start-up, cyclic exchange, health.

`arm` implements `acquisition.devices.Arm`: `startup` finds and checks the pucks,
`cyclic_io` requests positions and sends torques, `transmission` converts counts to
joint angles, `safety_module` and `status_poller` monitor in the free bus time. Begin
with `arm`.
"""
