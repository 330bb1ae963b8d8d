"""What the processes of a session share: ring buffers, slots, commands, calls.

While the loop runs, processes meet only in one piece of shared memory (`layout`, made
of `ring_buffer` and `latest_value`): the console sends `commands` by `loop_client`,
`loop_server` obeys and publishes. Between trials they call each other (`rpc`) over a
socket pair; `child` spawns and watches them. Begin with `layout`.
"""
