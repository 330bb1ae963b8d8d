"""Recorder: from shared memory to a verified trial file.

`recorder` drains the buffers to a `TrialWriter`, ends a file, verifies it and gives it
its final name; `recorder_process` runs it in a separate process.
"""
