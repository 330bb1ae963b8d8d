"""The recorder: from shared memory to a verified trial file.

`recorder` drains the buffers into a `TrialWriter`, ends a file, reads it back and gives
it its final name; `recorder_process` is the same in a process of its own.
"""
