"""The operator's interface: prompts, keys, screens, sounds; real or simulated.

`prompts` defines the prompts and `keys` their keys, `terminal` and `scripted` supply
answers, `screens` renders the screens, `console` imports rich; `pendant` and
`hand_orders` parse orders to the hands at a served arm. Begin with `prompts`.
"""
