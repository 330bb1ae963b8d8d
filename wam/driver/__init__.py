"""The arm as the control loop sees it: start-up, cyclic exchange, health.

`arm` implements `acquisition.Arm`: `startup` finds and checks the pucks, `cyclic_io`
asks positions and sends torques, `transmission` turns counts into joint angles,
`safety_module` and `status_poller` watch in the free bus time. Begin with `arm`.
"""
