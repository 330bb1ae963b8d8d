"""Clock, loop, samples and recording: knows no robot and no sensor brand."""
