"""What the processes of a session share: rings, slots, commands, calls.

While the loop runs, processes meet only in one piece of shared memory (`layout`, built
of `rings`): the console sends `commands` through `loop_client`, `loop_server` obeys and
publishes. Between trials they call each other (`rpc`) over a socket pair; `child`
spawns and watches them. Begin with `layout`.
"""
