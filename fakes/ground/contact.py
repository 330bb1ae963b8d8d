"""Types of a foot's contact: motion of the sole in, wrench of the ground out.

All in the terrain frame: x along the slip direction from the far end, z out of the
ground. Forces are those of the ground on the foot, F_t along -x.

Plain tuples for speed: they are created in every substep.
"""

DAMPING_MASS = 3.5  # mass that the normal damping ratio refers to [kg]

# Wrench of the ground on the foot: F_t along -x, F_y, F_n along z [N], and the moment
# about the centre of the sole [N m].
Contact = tuple[float, float, float, float, float, float]

# Motion of the sole: position x, y, z [m], velocity [m/s], angular velocity [rad/s].
Motion = tuple[float, float, float, float, float, float, float, float, float]

NO_CONTACT: Contact = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
