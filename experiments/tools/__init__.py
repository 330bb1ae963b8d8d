"""Programs beside sessions: benchmark, acceptance study, pendant script.

`bench` measures the loop on this machine, `acceptance` runs a whole simulated study,
`pendant` presses the buttons of a served simulated arm.
"""
