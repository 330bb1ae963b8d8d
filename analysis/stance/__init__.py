"""A foot that stands and is asked for traction, as a walking robot asks.

Begin with `interface`: what a policy is given and what it answers. `policies` holds the
four that are compared, `sequence` sets the foot down and asks the policy, `outcomes`
judges what came of it and adapts the risk.
"""
