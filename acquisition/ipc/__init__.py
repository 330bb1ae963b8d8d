"""What the processes of a session share: ring buffers, slots, commands, requests.

While the loop runs, processes meet only in one piece of shared memory (`layout`, made
of `ring_buffer` and `latest_value`): the console sends `commands` by `loop_client`,
`loop_server` obeys and publishes. Between trials they send each other `requests` over a
socket pair; `child` spawns and watches them, `simulation` has what a simulated rig is
asked for. Begin with `layout`.
"""
