"""The person at the rig: prompts, keys, screens, sounds; and one who is simulated.

`prompts` says what can be asked and which keys answer it, `terminal` and `scripted`
give the answers, `screens` is what is shown, `console` imports rich; `pendant` and
`hand_orders` read what the hands at a served arm are to do. Begin with `prompts`.
"""
