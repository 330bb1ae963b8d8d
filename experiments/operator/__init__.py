"""The person at the rig: prompts, keys, screens, sounds.

`prompts` says what can be asked and which keys answer it, `terminal` and `scripted`
give the answers, `console` imports rich, `screens` is what is shown.
"""
