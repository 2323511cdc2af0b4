from eitsim.scene.profiles.rounded_cone import Sphere


class Dome(Sphere):
    """A hemisphere of one and a half times the radius, cut at the shank."""

    @classmethod
    def of(cls, radius, fillet, half_angle_rad):
        return cls(radius, radius / 2)
