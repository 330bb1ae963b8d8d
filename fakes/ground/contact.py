"""A foot on the ground: motion in, force out.

Everything is in the terrain frame: x along the slip direction from the far end, z out
of the ground. Forces are those of the ground on the foot, F_t against x.

Both are plain tuples: they are made and taken apart in every substep.
"""

DAMPING_MASS = 3.5  # mass that the normal damping ratio refers to [kg]

# What the ground does to the foot: F_t against x, F_y, F_n along z [N], and the moment
# about the centre of the sole [N m].
Contact = tuple[float, float, float, float, float, float]

# The sole: position x, y, z [m], velocity [m/s], turning rate [rad/s].
Motion = tuple[float, float, float, float, float, float, float, float, float]

NO_CONTACT: Contact = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
