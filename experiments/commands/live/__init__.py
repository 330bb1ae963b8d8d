"""The second screen: sessions and trials for viewers with Foxglove's protocol.

`channels` turns samples into messages, `server` imports foxglove-sdk, `watching`
follows a session that another process records, `playback` shows a recorded trial
again, also in the terminal.
"""
