"""Communication of the processes of a session: ring buffers, slots, commands, requests.

While the loop runs, processes communicate only through one block of shared memory
(`layout`, made of `ring_buffer` and `latest_value`): the console sends `commands`
through `loop_client`, `loop_server` executes them and publishes its status. Between
trials they exchange `requests` over a socket pair; `child` spawns and monitors
processes, `simulation` has the requests to a simulated rig. Begin with `layout`.
"""
