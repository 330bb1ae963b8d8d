"""The steps of a commissioning as they are done: collected, judged, written.

Begin in `work`: its table says of each step how it is collected and judged. What
quantities may be stands in `limits`; a judgement looks at nothing but the recording.
"""
